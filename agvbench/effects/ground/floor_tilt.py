"""Slope of the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, X_RATE, Y_RATE
from agvbench.types import Floats

_MOVING_MPS = 0.003


@dataclass(frozen=True)
class FloorTilt(Effect):
    """A moving vehicle drifts down the slope: a constant velocity in the floor frame, at any heading.

    Moving means faster than some 3 mm/s, with a smooth share ``1 − exp(−(v / 0.003)²)``, so that a vehicle that comes
    to rest stops drifting.
    """

    name: ClassVar[str] = "floor_tilt"
    stage: ClassVar[Stage] = Stage.FLOOR
    relaxes: ClassVar[str] = "the floor is level (3.2)"
    reference: ClassVar[str] = "agvbench's own: the simplest equation for a slope of the floor"
    limits: ClassVar[str] = (
        "one slope for the whole floor, no part proportional to speed; only runs in several directions show it"
    )
    remedy: ClassVar[str] = "level the floor, or stop the draught; a run in the opposite direction confirms it"

    drift_mps: float = parameter(unit="m/s", low=0.0, high=0.2, scale=0.005)
    direction_rad: float = parameter(unit="rad", low=-math.tau, high=math.tau, scale=0.5)

    @staticmethod
    def drift(state: Floats, drift_mps: float, direction_rad: float) -> None:
        """Add the drift velocity while moving."""
        if drift_mps != 0.0:
            square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
            speed = -drift_mps * math.expm1(-square / _MOVING_MPS**2)
            state[X_RATE] += speed * math.cos(direction_rad)
            state[Y_RATE] += speed * math.sin(direction_rad)
