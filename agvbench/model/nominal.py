"""The nominal vehicle model, valid before any measurement."""

from __future__ import annotations

import math

from agvbench.model.vehicle_model import VehicleModel
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, FullSpeedOrStop, Line

_FULL_ANGLE_RAD = math.radians(45.0)
_FULL_SPEED_MPS = 0.32
_FULL_YAW_RATE = 1.0  # rad/s
# Neutral to full command, towards a left turn or forward: on the thesis' vehicle the pulse falls.
_FULL_COMMAND = {"us": -600.0, "normalised": 1.0}


def nominal_model(name: str, geometry: Geometry, channels: Channels, *, rear_steered: bool = True) -> VehicleModel:
    """Return the uncalibrated model: 45° and 0.32 m/s at full command, with full speed and stop as its only speeds.

    Full command is 600 µs below neutral for a left turn and for driving forward, +1 in normalised units, and in either
    not beyond the range of the channel; commands in SI units are taken at their word. A differential vehicle has a
    yaw rate of 1 rad/s at full command in place of the angle, and every speed up to full speed can be commanded.

    Parameters
    ----------
    name, geometry, channels
        As in `VehicleModel`.
    rear_steered
        Whether the rear axle is steered; otherwise it points straight ahead.

    Examples
    --------
    >>> model = nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))
    >>> model.command_for(front_rad=math.radians(15.0), rear_rad=0.0, speed_mps=0.32)
    Command(drive=900.0, front=1300.0, rear=1500.0)
    """
    is_differential = geometry.is_differential
    steered = not is_differential and rear_steered
    at_full = "0.32 m/s and 1 rad/s" if is_differential else "45° and 0.32 m/s"
    return VehicleModel(
        name=name,
        geometry=geometry,
        channels=channels,
        front=_line(channels.front, _FULL_YAW_RATE if is_differential else _FULL_ANGLE_RAD),
        rear=_line(channels.rear, _FULL_ANGLE_RAD) if steered else Fixed(command=channels.rear.neutral),
        drive=_line(channels.drive, _FULL_SPEED_MPS) if is_differential else _full_speed_or_stop(channels.drive),
        provenance={"source": f"nominal: {at_full} at full command, nothing measured"},
    )


def _line(channel: Channel, full_output: float) -> Line:
    full, low, high = _full_command(channel, full_output)
    return Line.through(channel.neutral, full_output / full, command_low=low, command_high=high)


def _full_speed_or_stop(channel: Channel) -> FullSpeedOrStop:
    full, low, high = _full_command(channel, _FULL_SPEED_MPS)
    at_high = math.copysign(_FULL_SPEED_MPS, full)
    return FullSpeedOrStop(low, channel.neutral, high, output_low=-at_high, output_high=at_high)


def _full_command(channel: Channel, full_output: float) -> tuple[float, float, float]:
    """Return what full command adds to neutral, and the lowest and highest command, within the channel's range.

    A side without any range keeps its place in the map; the range itself keeps it from being commanded.
    """
    neutral = channel.neutral
    full = full_output if channel.unit == "si" else _FULL_COMMAND[channel.unit]
    size = min(abs(full), max(neutral - channel.low, channel.high - neutral))
    low, high = max(neutral - size, channel.low), min(neutral + size, channel.high)
    low, high = low if low < neutral else neutral - size, high if high > neutral else neutral + size
    return math.copysign(size, full), low, high
