"""What the three command channels of a vehicle set: a speed, and angles of axles or a yaw rate; and in which units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from agvbench.vehicle.geometry import Geometry

Role = Literal["front", "rear", "drive"]
"""A command channel, by the name of its column in the table of commands."""

ROLES: tuple[Role, ...] = ("front", "rear", "drive")


@dataclass(frozen=True)
class Quantity:
    """What a channel sets.

    Parameters
    ----------
    channel
        What people call the channel: ``"front axle"``, ``"yaw rate"``.
    name
        What it sets: ``"angle"``, ``"speed"`` or ``"yaw rate"``.
    scale
        From the SI unit to `unit`.
    unit, word
        The unit people read, as a symbol (``"°"``) and in tables (``"deg"``).
    """

    channel: str
    name: str
    scale: float = 1.0
    unit: str = ""
    word: str = ""

    def text(self, value: float, form: str = ".3g") -> str:
        """Return an SI value with its unit, the number in this `form`."""
        return f"{self.scale * value:{form}}{'' if self.unit == '°' else ' '}{self.unit}"


_DEG = math.degrees(1.0)
_TWO_AXLE = {
    "front": Quantity("front axle", "angle", _DEG, "°", "deg"),
    "rear": Quantity("rear axle", "angle", _DEG, "°", "deg"),
    "drive": Quantity("drive", "speed", 1.0, "m/s", "m/s"),
}
_YAW_RATE = Quantity("yaw rate", "yaw rate", 1.0, "rad/s", "rad/s")


def quantity_of(role: str, geometry: Geometry) -> Quantity:
    """Return what the channel `role` of a vehicle sets.

    >>> quantity_of("front", Geometry(0.0, 0.1, kinematics="differential")).text(0.5)
    '0.5 rad/s'
    """
    return _YAW_RATE if geometry.is_differential and role == "front" else _TWO_AXLE[role]


def channels_of(geometry: Geometry) -> tuple[Role, ...]:
    """Return the channels that a vehicle has: a differential one has no rear axle to steer."""
    return ("front", "drive") if geometry.is_differential else ROLES
