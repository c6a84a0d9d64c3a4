"""The nominal vehicle model, valid before any measurement."""

from __future__ import annotations

import math

from agvbench.model.vehicle_model import VehicleModel
from agvbench.types import CommandUnit
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, FullSpeedOrStop, Line

_FULL_ANGLE_RAD = math.radians(45.0)
_FULL_SPEED_MPS = 0.32
# Neutral to full command, towards a left turn or forward: on the thesis' vehicle the pulse falls.
_FULL_COMMAND = {"us": -600.0, "normalised": 1.0}


def nominal_model(
    name: str, geometry: Geometry, command_unit: CommandUnit, neutral: float, *, rear_steered: bool = True
) -> VehicleModel:
    """Return the uncalibrated model: 45° and 0.32 m/s at full command, with full speed and stop as its only speeds.

    Full command is 600 µs below neutral for a left turn and for driving forward, or +1 in normalised units.

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
    geometry.require_two_axles(
        "a nominal vehicle has steered axles", where=f"vehicle {name}", remedy="give a vehicle file with its maps"
    )
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
