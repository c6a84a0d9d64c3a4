"""The nominal vehicle model, valid before any measurement."""

from __future__ import annotations

import math

from agvbench.model.vehicle_model import VehicleModel
from agvbench.types import CommandUnit
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, FullSpeedOrStop, Line

_FULL_ANGLE_RAD = math.radians(45.0)
_FULL_SPEED_MPS = 0.32
_FULL_YAW_RATE = 1.0  # rad/s
# Neutral to full command, towards a left turn or forward: on the thesis' vehicle the pulse falls.
_FULL_COMMAND = {"us": -600.0, "normalised": 1.0}


def nominal_model(
    name: str, geometry: Geometry, command_unit: CommandUnit, neutral: float, *, rear_steered: bool = True
) -> VehicleModel:
    """Return the uncalibrated model: 45° and 0.32 m/s at full command, with full speed and stop as its only speeds.

    Full command is 600 µs below neutral for a left turn and for driving forward, or +1 in normalised units. A
    differential vehicle has a yaw rate of 1 rad/s at full command in place of the angle; in SI units its commands are
    taken at their word, and every speed up to full speed can be commanded.

    Parameters
    ----------
    name, geometry, command_unit, neutral
        As in `VehicleModel`.
    rear_steered
        Whether the rear axle is steered; otherwise it points straight ahead.

    Examples
    --------
    >>> model = nominal_model("agv", Geometry(0.181, 0.121), "us", 1500.0)
    >>> model.command_for(front_rad=math.radians(15.0), rear_rad=0.0, speed_mps=0.32)
    Command(drive=900.0, front=1300.0, rear=1500.0)
    """
    if geometry.is_differential:
        return _nominal_differential(name, geometry, command_unit, neutral)
    full = _FULL_COMMAND.get(command_unit, 1.0)
    low, high = neutral - abs(full), neutral + abs(full)
    steering = Line.through(neutral, _FULL_ANGLE_RAD / full, command_low=low, command_high=high)
    at_high = math.copysign(_FULL_SPEED_MPS, full)
    return VehicleModel(
        name=name,
        geometry=geometry,
        command_unit=command_unit,
        neutral=neutral,
        front=steering,
        rear=steering if rear_steered else Fixed(command=neutral),
        drive=FullSpeedOrStop(low, neutral, high, output_low=-at_high, output_high=at_high),
        provenance={"source": "nominal: 45° and 0.32 m/s at full command, nothing measured"},
    )


def _nominal_differential(name: str, geometry: Geometry, command_unit: CommandUnit, neutral: float) -> VehicleModel:
    def line(full_output: float) -> Line:
        full = full_output if command_unit == "si" else _FULL_COMMAND[command_unit]
        low, high = neutral - abs(full), neutral + abs(full)
        return Line.through(neutral, full_output / full, command_low=low, command_high=high)

    return VehicleModel(
        name=name,
        geometry=geometry,
        command_unit=command_unit,
        neutral=neutral,
        front=line(_FULL_YAW_RATE),
        rear=Fixed(command=neutral),
        drive=line(_FULL_SPEED_MPS),
        provenance={"source": "nominal: 0.32 m/s and 1 rad/s at full command, nothing measured"},
    )
