"""Constant acceleration, and exponential braking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import BODY_ACCELERATION_LIMIT, BRAKE_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3
_SHORTEST_S = 0.01


@dataclass(frozen=True)
class SpeedLagRampUp(Variant):
    """The force of the drive limits the acceleration, and viscous friction brakes.

    The body's ``|v̇| ≤ acceleration`` while |v| grows, and ``v̇ = (v_map − v) / T`` while it falls. From forward to
    backward the vehicle brakes to rest first and accelerates then.
    """

    name: ClassVar[str] = "speed_lag_ramp_up"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.1: distances of acceleration and braking"
    limits: ClassVar[str] = "at one speed alone a ramp and a lag of half its time give the same distance"

    acceleration_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    brake_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a ramp over the distance of the library's lag, at a typical speed and at twice that."""
        lag = max(fitted["accelerate_s"], _SHORTEST_S)
        return [(speed / (2.0 * lag), fitted["brake_s"]) for speed in (_TYPICAL_MPS, 2.0 * _TYPICAL_MPS)]

    @staticmethod
    def aim(state: Floats, acceleration_mps2: float, brake_s: float) -> None:
        """Set the limit and the lag of the drive."""
        state[BODY_ACCELERATION_LIMIT] = min(state[BODY_ACCELERATION_LIMIT], acceleration_mps2)
        state[BRAKE_LAG] = max(state[BRAKE_LAG], brake_s)
