"""The page on vehicle files knows every kind of map and all its keys, and its example is a vehicle."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from agvbench.model import VehicleModel
from agvbench.vehicle.maps import map_kinds

TEXT = (Path(__file__).parents[2] / "docs" / "reference" / "vehicle-file.md").read_text(encoding="utf-8")


def test_its_example_is_a_vehicle(tmp_path):
    example, robot = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    (tmp_path / "robot.toml").write_text(robot)
    assert VehicleModel.load(tmp_path / "robot.toml").geometry.is_differential
    (tmp_path / "car.toml").write_text(example)
    car = VehicleModel.load(tmp_path / "car.toml")
    assert float(car.front(1500.0)) == pytest.approx(0.0)
    assert float(car.rear(900.0)) == 0.0
    assert [effect.name for effect in car.effects] == ["steering_lag"]


@pytest.mark.parametrize("kind", sorted(map_kinds()))
def test_every_kind_stands_there_with_its_keys(kind):
    (row,) = re.findall(rf"^\| `{kind}` \| (.*?) \|", TEXT, re.MULTILINE)
    assert re.findall(r"`(\w+)`", row) == [f.name for f in fields(map_kinds()[kind])]
