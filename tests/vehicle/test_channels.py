"""Command channels: what describes one, and how files say it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.errors import VehicleError
from agvbench.types import Command, Commands
from agvbench.vehicle.channel_tables import channels_from_keys, channels_to_keys
from agvbench.vehicle.channels import Channel, Channels

HALF = Channel("normalised", 0.5, 0.0, 1.0)
MIXED = Channels(Channel("us", 1500.0, 1000.0, 2000.0), HALF, Channel("si", 0.0, -0.6, 0.6))
TABLES = {
    "drive": {"unit": "us", "neutral": 1500.0, "low": 1000.0, "high": 2000.0},
    "front": {"unit": "normalised", "neutral": 0.5, "low": 0.0, "high": 1.0},
    "rear": {"unit": "rad", "neutral": 0.0, "low": -0.6, "high": 0.6},
}

ends = st.floats(-1e4, 1e4).map(lambda value: round(value, 3))


@st.composite
def bounded(draw: st.DrawFn) -> Channel:
    low, neutral, high = sorted(draw(st.lists(ends, min_size=3, max_size=3, unique=True)))
    return Channel(draw(st.sampled_from(["us", "normalised", "si"])), neutral, low, high)


@given(drive=bounded(), front=bounded(), rear=bounded())
def test_what_is_written_reads_back_as_it_was(drive: Channel, front: Channel, rear: Channel) -> None:
    for kinematics, channels in (
        ("two_axle", Channels(drive, front, rear)),
        ("differential", Channels(drive, front, front)),
    ):
        assert channels_from_keys(channels_to_keys(channels, kinematics), kinematics) == channels


@given(unit=st.sampled_from(["us", "normalised", "si"]), neutral=ends)
def test_channels_that_are_alike_are_written_as_one_unit_and_neutral(unit: Any, neutral: float) -> None:
    channels = Channels.alike(unit, neutral)
    keys = channels_to_keys(channels, "two_axle")
    assert keys == {"command_unit": unit, "neutral": neutral}
    assert channels_from_keys(keys, "differential") == channels


def test_a_file_names_si_units_by_their_symbols() -> None:
    assert channels_to_keys(MIXED, "two_axle") == {"channels": TABLES}
    robot = Channels(Channel("si", 0.0, -1.0, 1.0), *[Channel("si", 0.0, -2.0, 2.0)] * 2)
    tables = channels_to_keys(robot, "differential")["channels"]
    assert {name: table["unit"] for name, table in tables.items()} == {"speed": "m/s", "yaw_rate": "rad/s"}


def test_each_channel_has_its_own_neutral() -> None:
    assert MIXED.neutral == Command(1500.0, 0.5, 0.0)
    assert MIXED.common is None
    assert (MIXED.table_unit, Channels.alike("si").table_unit) == ("channels", "si")


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (("volt", 0.0), "unit: unknown unit: 'volt' (one of: us, normalised, si)"),
        (("us", math.nan), "neutral: must be a finite number: nan"),
        (("us", 1500.0, 2000.0, 1000.0), "low: is not below high: 2000 (limit: below 1000)"),
        (("us", 1500.0, 1500.0, 1500.0), "low: is not below high: 1500 (limit: below 1500)"),
        (("normalised", 1.5, 0.0, 1.0), "neutral: is out of range: 1.5 (limit: 0…1)"),
    ],
)
def test_a_channel_that_cannot_be_is_refused(values: tuple[Any, ...], line: str) -> None:
    with pytest.raises(VehicleError) as raised:
        Channel(*values)
    assert str(raised.value) == line


def _with(name: str, **changed: object) -> dict[str, Any]:
    table = {key: value for key, value in {**TABLES[name], **changed}.items() if value is not None}
    return {"channels": {**TABLES, name: table}}


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ({"channels": 3}, "channels: must be a table: 3"),
        (
            {"channels": {"drive": TABLES["drive"], "front": TABLES["front"]}},
            "channels.rear: a table is missing; add [channels.rear]",
        ),
        ({"channels": {**TABLES, "raer": {}}}, "channels: unknown key: raer; did you mean rear?"),
        ({"channels": {**TABLES, "front": 0.5}}, "channels.front: must be a table: 0.5"),
        (_with("front", low=None), "channels.front: a key is missing: low; add low = …"),
        (_with("front", lower=0.0), "channels.front: unknown key: lower; did you mean low?"),
        (_with("front", unit="m/s"), "channels.front.unit: unknown unit: 'm/s' (one of: us, normalised, rad)"),
        (_with("drive", unit=5), "channels.drive.unit: unknown unit: 5 (one of: us, normalised, m/s)"),
        (_with("drive", unit="si"), "channels.drive.unit: unknown unit: 'si' (one of: us, normalised, m/s)"),
        (_with("front", neutral="half"), "channels.front.neutral: must be a number: 'half'"),
        (_with("front", high=math.inf), "channels.front.high: must be a finite number: inf"),
        (_with("front", neutral=-1.0), "channels.front.neutral: is out of range: -1 (limit: 0…1)"),
        (_with("front", low=1.0), "channels.front.low: is not below high: 1 (limit: below 1)"),
        (
            {"channels": TABLES, "neutral": 0.0},
            "neutral: the channels are described twice (limit: command_unit and neutral, or [channels])",
        ),
    ],
)
def test_a_table_that_cannot_be_is_refused_in_one_line(content: dict[str, Any], line: str) -> None:
    with pytest.raises(VehicleError) as raised:
        channels_from_keys(content, "two_axle")
    assert str(raised.value).startswith(line)


def test_a_command_out_of_range_is_refused() -> None:
    t_s, straight = np.array([0.0, 1.0]), np.array([0.5, 0.5])
    MIXED.require_within(Commands(t_s, np.array([1000.0, 2000.0]), straight, np.zeros(2)), where="run a")
    with pytest.raises(VehicleError, match=r"run a: front command is out of its channel's range: 1\.1 \(limit: 0…1\)"):
        MIXED.require_within(Commands(t_s, np.full(2, 1500.0), np.array([0.5, 1.1]), np.zeros(2)), where="run a")
