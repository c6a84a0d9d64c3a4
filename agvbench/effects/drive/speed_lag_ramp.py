"""Constant acceleration and braking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATION_LIMIT, BRAKING_LIMIT
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3
_SHORTEST_S = 0.01


@dataclass(frozen=True)
class SpeedLagRamp(Variant):
    """The wheels' speed ramps: ``|v̇| ≤ acceleration`` while |v| grows, ``|v̇| ≤ braking`` while it falls.

    A motor controller does so. From forward to backward the vehicle brakes to rest first and accelerates then.
    """

    name: ClassVar[str] = "speed_lag_ramp"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.1: distances of acceleration and braking"
    limits: ClassVar[str] = "at one speed alone a ramp and a lag of half its time give the same distance"

    acceleration_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    braking_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with ramps over the distance of the library's lags, at a typical speed and at twice that."""
        lags = [max(fitted[name], _SHORTEST_S) for name in ("accelerate_s", "brake_s")]
        return [(speed / (2.0 * lags[0]), speed / (2.0 * lags[1])) for speed in (_TYPICAL_MPS, 2.0 * _TYPICAL_MPS)]

    @staticmethod
    def aim(state: Floats, acceleration_mps2: float, braking_mps2: float) -> None:
        """Set the limits of the drive."""
        state[ACCELERATION_LIMIT] = min(state[ACCELERATION_LIMIT], acceleration_mps2)
        state[BRAKING_LIMIT] = min(state[BRAKING_LIMIT], braking_mps2)
