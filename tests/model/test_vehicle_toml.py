"""Vehicle files: exact round trips, and one clear line for every mistake."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from agvbench.effects import ActuationDelay, AxleOverrun, SpeedLag, SteeringLag
from agvbench.errors import AgvbenchError, FileError, VehicleError
from agvbench.model import VehicleModel, example_names, example_vehicle, thesis_vehicle
from agvbench.model.toml import vehicle_to_toml

THESIS = vehicle_to_toml(thesis_vehicle().with_effects(SteeringLag(0.1)))


@pytest.mark.parametrize("name", example_names())
def test_save_and_load_give_the_same_vehicle_and_the_same_bytes(name: str, tmp_path: Path) -> None:
    model = example_vehicle(name).with_effects(ActuationDelay(0.1), SteeringLag(1.0 / 3.0), SpeedLag(0.29, 0.59))
    model.save(tmp_path / "a.toml")
    again = VehicleModel.load(tmp_path / "a.toml")
    again.save(tmp_path / "b.toml")
    assert again == model
    assert again.calibration_hash == model.calibration_hash
    assert (tmp_path / "a.toml").read_bytes() == (tmp_path / "b.toml").read_bytes()


def test_the_driven_axle_is_kept_and_is_part_of_the_physics(tmp_path: Path) -> None:
    model = thesis_vehicle()
    rear = replace(model, geometry=replace(model.geometry, driven="rear"))
    rear.save(tmp_path / "v.toml")
    again = VehicleModel.load(tmp_path / "v.toml")
    assert again == rear
    assert again.calibration_hash != model.calibration_hash
    assert "driven" not in vehicle_to_toml(model)["geometry"]


def test_an_effect_of_two_driven_axles_needs_both() -> None:
    model = thesis_vehicle()
    rear = replace(model, geometry=replace(model.geometry, driven="rear"))
    assert rear.with_effects(AxleOverrun(0.0)).effects
    with pytest.raises(VehicleError, match=r'axle_overrun.*driven = "rear".*correct geometry.driven'):
        rear.with_effects(AxleOverrun(2.0))


def test_the_file_says_its_units(tmp_path: Path) -> None:
    thesis_vehicle().save(tmp_path / "v.toml")
    text = (tmp_path / "v.toml").read_text()
    assert text.count('unit = "rad"') == 2
    assert text.count('unit = "m/s"') == 1


def put(*path: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    def edit(content: Any) -> None:
        for key in path[:-1]:
            content = content[key]
        content[path[-1]] = value

    return edit


def drop(*path: str | int) -> Callable[[dict[str, Any]], None]:
    def edit(content: Any) -> None:
        for key in path[:-1]:
            content = content[key]
        del content[path[-1]]

    return edit


MISTAKES = {
    "no schema": (drop("schema"), "top level: a key is missing: schema; add schema = 1"),
    "future schema": (put("schema", value=2), "schema: unknown schema: 2 (limit: 1)"),
    "no name": (drop("name"), "top level: a key is missing: name"),
    "name is a number": (put("name", value=3), "name: must be a text: 3"),
    "no unit": (drop("command_unit"), "top level: a key is missing: command_unit"),
    "bad unit": (put("command_unit", value="ms"), "command_unit: unknown unit: 'ms' (one of: us, normalised, si)"),
    "neutral is a text": (put("neutral", value="1500"), "neutral: must be a number: '1500'"),
    "neutral is NaN": (put("neutral", value=math.nan), "neutral: must be a number: NaN"),
    "neutral is infinite": (put("neutral", value=math.inf), "neutral: must be a finite number: inf"),
    "unknown key": (put("colour", value="red"), "top level: unknown key: colour"),
    "misspelt key": (put("effect", value=[]), "top level: unknown key: effect; did you mean effects?"),
    "no geometry": (drop("geometry"), "top level: a key is missing: geometry"),
    "geometry is a number": (put("geometry", value=0.3), "geometry: must be a table: 0.3"),
    "no rear axle": (drop("geometry", "rear_axle_m"), "geometry: a key is missing: rear_axle_m"),
    "negative length": (
        put("geometry", "front_axle_m", value=-0.2),
        "geometry.front_axle_m: must be greater than zero: -0.2",
    ),
    "length is NaN": (put("geometry", "front_axle_m", value=math.nan), "geometry.front_axle_m: must be a number: NaN"),
    "length in mm": (put("geometry", "front_axle_mm", value=181), "geometry: unknown key: front_axle_mm; did you mean"),
    "no maps": (drop("maps"), "top level: a key is missing: maps"),
    "no drive map": (drop("maps", "drive"), "maps.drive: a table is missing; add [maps.drive]"),
    "unknown map": (put("maps", "third", value={}), "maps: unknown key: third"),
    "map is a text": (put("maps", "front", value="line"), "maps.front: must be a table: 'line'"),
    "unknown kind": (put("maps", "front", "kind", value="spline"), "maps.front.kind: unknown kind of map: 'spline'"),
    "degrees": (put("maps", "front", "unit", value="deg"), "maps.front.unit: wrong unit: 'deg' (limit: rad)"),
    "no slope": (drop("maps", "front", "slope"), "maps.front: a key is missing: slope"),
    "slope is a list": (put("maps", "front", "slope", value=[1.0]), "maps.front.slope: must be a number: [1.0]"),
    "slope is true": (put("maps", "front", "slope", value=True), "maps.front.slope: must be a number: True"),
    "stop beyond a right angle": (
        put("maps", "front", "output_high", value=1.6),
        "maps.front: axle angle is too large: 91.7°",
    ),
    "a table with a text": (
        put("maps", "drive", "outputs", 3, value="fast"),
        "maps.drive.outputs[3]: must be a number: 'fast'",
    ),
    "a table that turns around": (put("maps", "drive", "outputs", 3, value=0.1), "maps.drive.outputs: outputs must"),
    "effects is a table": (put("effects", value={}), "effects: must be a list of tables; write [[effects]]"),
    "unknown effect": (put("effects", 0, "name", value="gremlins"), "effects[0].name: unknown effect: 'gremlins'"),
    "effect twice": (put("effects", value=THESIS["effects"] * 2), "effects: an effect may be given once: steering_lag"),
    "negative lag": (
        put("effects", 0, "time_constant_s", value=-0.1),
        "effects[0].time_constant_s: is out of bounds: -0.1 s (limit: 0 … 5 s)",
    ),
    "provenance is nested": (put("provenance", "by", value={}), "provenance.by: must be a text or a number: {}"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_file_is_told_in_one_line(mistake: str, tmp_path: Path) -> None:
    edit, message = MISTAKES[mistake]
    content = copy.deepcopy(THESIS)
    edit(content)
    path = tmp_path / "vehicle.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    with pytest.raises(VehicleError) as caught:
        VehicleModel.load(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"schema = = 1", "the vehicle file is not TOML: Invalid value"),
        (b"name = '\xff'", "the vehicle file is not UTF-8 text"),
        (None, "cannot read the vehicle file: No such file or directory"),
    ],
)
def test_a_file_that_cannot_be_read(content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError) as caught:
        VehicleModel.load(path)
    assert str(caught.value).startswith(f"{path}: {message}")


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot write the vehicle file"):
        thesis_vehicle().save(tmp_path / "missing" / "vehicle.toml")
    assert issubclass(FileError, AgvbenchError)
