"""Two wheel speeds as commands: exact conversion, saturation with the curvature kept, files, and refused input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.errors import VehicleError
from agvbench.types import Command, Commands
from agvbench.vehicle.channel_tables import channels_from_keys, channels_to_keys
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.wheels import WheelCommand, Wheels

METRES = Wheels(Channel("si", 0.0, -0.5, 0.5), Channel("si", 0.0, -0.5, 0.5), track_m=0.3)
ANGULAR = Wheels(Channel("si", 0.0, -10.0, 10.0), Channel("si", 0.0, -10.0, 10.0), track_m=0.3, wheel_radius_m=0.05)
PULSES = Wheels(Channel("us", 1500.0, 1000.0, 2000.0), Channel("us", 1480.0, 1100.0, 2000.0))
KINDS = {"m/s": METRES, "rad/s": ANGULAR, "us": PULSES}
each = pytest.mark.parametrize("wheels", KINDS.values(), ids=KINDS.keys())


def table(unit: str, neutral: float = 0.0, low: float = -0.5, high: float = 0.5) -> dict[str, object]:
    return {"unit": unit, "neutral": neutral, "low": low, "high": high}


@each
@given(left=st.floats(-1.0, 1.0), right=st.floats(-1.0, 1.0))
def test_the_conversion_loses_nothing(wheels: Wheels, left: float, right: float) -> None:
    given_ = [c.neutral + share * (c.high - c.neutral) for share, c in zip((left, right), wheels.channels, strict=True)]
    back = wheels.wheels(*wheels.body(*given_))
    np.testing.assert_allclose(back, given_, rtol=0.0, atol=1e-12 * max(map(abs, (*given_, 1.0))))


def test_the_body_moves_as_its_wheels_roll() -> None:
    """On a circle the outer wheel's path is longer by the track."""
    speed, yaw_rate = (float(value) for value in METRES.body(0.2, 0.4))
    radius = speed / yaw_rate
    assert (radius - 0.15) * yaw_rate == pytest.approx(0.2)
    assert (radius + 0.15) * yaw_rate == pytest.approx(0.4)
    rolled = ANGULAR.body(0.2 / 0.05, 0.4 / 0.05)
    np.testing.assert_allclose(rolled, [speed, yaw_rate], rtol=1e-12)


def test_the_ranges_of_the_body_are_what_both_wheels_reach() -> None:
    assert (METRES.drive.low, METRES.drive.high) == (-0.5, 0.5)
    assert METRES.front.high == pytest.approx(0.5 / 0.15)
    # The right wheel goes down by 380 µs and up by 520, the left one by 500 either way.
    assert (PULSES.drive.low, PULSES.drive.high) == (-380.0, 500.0)
    assert (PULSES.front.low, PULSES.front.high) == (-380.0, 500.0)


@each
@given(drive=st.floats(-3.0, 3.0), front=st.floats(-3.0, 3.0))
def test_a_wheel_that_saturates_slows_both_and_keeps_the_curvature(wheels: Wheels, drive: float, front: float) -> None:
    asked = Command(drive * wheels.drive.high, front * wheels.front.high, 0.0)
    done = wheels.limited(asked)
    assert done.front * asked.drive == pytest.approx(done.drive * asked.front, abs=1e-9 * (1.0 + abs(asked.front)))
    for value, channel in zip(wheels.command(asked), wheels.channels, strict=True):
        assert channel.holds(value)
    if done != asked:  # no slower than it must be: one wheel is at an end
        ends = [
            min(abs(v - c.low), abs(v - c.high)) for v, c in zip(wheels.command(asked), wheels.channels, strict=True)
        ]
        assert min(ends) <= 1e-9 * (PULSES.left.high - PULSES.left.low)
    else:
        np.testing.assert_allclose(wheels.command(asked), wheels.wheels(asked.drive, asked.front), atol=1e-6)


@each
def test_rest_is_the_neutral_of_each_wheel(wheels: Wheels) -> None:
    channels = Channels.of_wheels(wheels)
    assert channels.neutral == Command(0.0, 0.0, 0.0)
    assert wheels.command(channels.neutral) == wheels.neutral == WheelCommand(*(c.neutral for c in wheels.channels))


@each
def test_a_file_keeps_them(wheels: Wheels) -> None:
    channels = Channels.of_wheels(wheels)
    assert channels_from_keys(channels_to_keys(channels, "differential"), "differential") == channels


def test_a_plan_beyond_a_wheel_is_refused_with_the_speed_that_is_left() -> None:
    channels = Channels.of_wheels(METRES)
    zeros = np.zeros(2)
    channels.require_within(
        Commands(np.array([0.0, 1.0]), np.array([0.5, 0.35]), np.array([0.0, 1.0]), zeros), where="a"
    )
    commands = Commands(np.array([0.0, 1.0]), np.array([0.2, 0.4]), np.array([0.0, 1.5]), zeros)
    with pytest.raises(
        VehicleError,
        match=r"run a: right wheel command is out of its channel's range: 0.625 \(limit: -0.5…0.5\); "
        r"drive at most 80 % of this speed",
    ):
        channels.require_within(commands, where="run a")


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"left": table("m/s"), "track_m": 0.3}, r"channels\.right: a table is missing; add \[channels\.right\]"),
        ({"track_m": 0.3}, r"channels\.left: a table is missing"),
        (
            {"left": table("m/s"), "right": table("m/s")},
            r"channels\.track_m: the distance between both wheels is missing; add track_m = … in \[channels\]",
        ),
        (
            {"left": table("m/s"), "right": table("m/s"), "track_m": 0.3, "speed": table("m/s")},
            r"channels\.speed: commands are of the body or of its wheels, not of both .* delete \[channels\.speed\]",
        ),
        (
            {"left": table("rad/s"), "right": table("rad/s"), "track_m": 0.3},
            r"channels\.left\.unit: unknown unit: 'rad/s' .* add wheel_radius_m = … in \[channels\]",
        ),
        (
            {"left": table("m/s"), "right": table("us", 0.0), "track_m": 0.3},
            r"channels\.right\.unit: both wheels need one unit: us \(limit: si\)",
        ),
        ({"left": table("m/s"), "right": table("m/s"), "track_m": -0.3}, r"track_m: is no length .*: -0.3 m"),
        ({"left": table("m/s"), "right": table("m/s"), "track_m": "wide"}, r"channels\.track_m"),
        (
            {"left": table("us", 0.0), "right": table("us", 0.0), "track_m": 0.3},
            r"track_m and wheel_radius_m need commands in m/s or rad/s: us",
        ),
        (
            {"left": table("m/s", low=0.0), "right": table("m/s"), "track_m": 0.3},
            r"channels\.left: a wheel turns both ways",
        ),
        ({"left": table("m/s"), "right": table("m/s"), "track": 0.3, "track_m": 0.3}, r"channels.*track"),
    ],
)
def test_a_description_that_cannot_be_is_one_line(tables: dict[str, object], message: str) -> None:
    with pytest.raises(VehicleError, match=message) as caught:
        channels_from_keys({"channels": tables}, "differential")
    assert "\n" not in str(caught.value)


def test_two_axles_have_no_wheel_channels() -> None:
    with pytest.raises(VehicleError, match="left"):
        channels_from_keys({"channels": {"left": table("m/s"), "right": table("m/s"), "track_m": 0.3}}, "two_axle")


def test_a_range_that_never_ends_is_refused() -> None:
    with pytest.raises(VehicleError, match="within a finite range"):
        Wheels(Channel("si", 0.0), Channel("si", 0.0, -math.inf, 0.5), track_m=0.3)
