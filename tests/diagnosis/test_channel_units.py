"""A diagnosis does not depend on the channels that the commands were given in."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_vehicle import HEADER, NEUTRAL, Tiny, front_of, rear_of

from agvbench.calibration import calibrate
from agvbench.campaign import CampaignWriter
from agvbench.cli import main
from agvbench.model import VehicleModel
from agvbench.types import Commands, Run
from agvbench.vehicle.channels import Channel, Channels

TRUE = Tiny(steering_lag_s=0.15, delay_s=0.05)
CHANNELS = Channels(
    Channel("us", 1500.0, 900.0, 2100.0), Channel("normalised", 0.5, 0.0, 1.0), Channel("si", 0.0, -1.0, 1.0)
)
PER_RAD = -650.0
LEVELS_US = np.array([1150.0, 1300.0, 1400.0, 1600.0, 1700.0])


def front_share(pulse_us: Any) -> Any:
    return 0.5 - (pulse_us - NEUTRAL) / 1250.0


def rear_rad(pulse_us: Any) -> Any:
    return (pulse_us - NEUTRAL) / PER_RAD


def in_channels(run: Run) -> Run:
    c = run.commands
    return dataclasses.replace(run, commands=Commands(c.t_s, c.drive, front_share(c.front), rear_rad(c.rear)))


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory, tiny_campaign: Callable[..., Any]) -> tuple[Path, Path]:
    """The same runs with pulses, and with a channel for each."""
    folder = tmp_path_factory.mktemp("channels")
    runs = tiny_campaign(TRUE).runs
    for name, header, own in (
        ("pulses", HEADER, runs),
        ("channels", dataclasses.replace(HEADER, schema=4, channels=CHANNELS), map(in_channels, runs)),
    ):
        writer = CampaignWriter.create(folder / name, header)
        for run in own:
            writer.append(run)
    return folder / "pulses", folder / "channels"


def test_the_calibrated_maps_are_those_of_the_vehicle(campaigns: tuple[Path, Path], tmp_path: Path) -> None:
    assert main(["calibrate", str(campaigns[1]), "--out", str(tmp_path / "v.toml")]) == 0
    model, of_pulses = VehicleModel.load(tmp_path / "v.toml"), calibrate(campaigns[0]).model
    assert model.channels == CHANNELS
    for pulse_us in LEVELS_US.tolist():
        assert float(model.front(front_share(pulse_us))) == pytest.approx(front_of(pulse_us), abs=0.004)
        assert float(model.rear(rear_rad(pulse_us))) == pytest.approx(rear_of(pulse_us), abs=0.004)
        assert float(model.speed(pulse_us)) == pytest.approx(float(of_pulses.speed(pulse_us)), abs=1e-4)


@pytest.mark.slow
def test_the_same_effects_are_found(campaigns: tuple[Path, Path], tmp_path: Path) -> None:
    found = []
    for path in campaigns:
        file, out = tmp_path / f"{path.name}.json", tmp_path / f"{path.name}.toml"
        assert main(["diagnose", str(path), "--json", str(file), "--out", str(out)]) == 0
        content = json.loads(file.read_text())
        model = VehicleModel.load(out)
        values = {
            f"{effect['name']}.{name}": parameter["value"]
            for effect in content["effects"]
            for name, parameter in effect["parameters"].items()
        }
        found.append((content["verdict"], values, model))
    (verdict, of_pulses, one), (same, values, other) = found
    assert verdict == same
    assert {"steering_lag.time_constant_s", "actuation_delay.delay_s"} <= set(values) == set(of_pulses)
    assert values == pytest.approx(of_pulses, rel=0.02, abs=1e-3)
    assert other.channels == CHANNELS
    np.testing.assert_allclose(other.front(front_share(LEVELS_US)), one.front(LEVELS_US), atol=1e-3)
    np.testing.assert_allclose(other.rear(rear_rad(LEVELS_US)), one.rear(LEVELS_US), atol=1e-3)
    np.testing.assert_allclose(other.speed(LEVELS_US), one.speed(LEVELS_US), atol=1e-3)
