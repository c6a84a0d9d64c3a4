"""First-order lag of a motor with limited force, and coasting without power."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    ACCELERATE_LAG,
    BODY_ACCELERATION_LIMIT,
    BODY_BRAKING_LIMIT,
    BRAKE_LAG,
    SPEED_AIM,
)
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 1.0
_SHORTEST_S = 0.01


@dataclass(frozen=True)
class SpeedLagLimited(Variant):
    """A powered motor follows its command as ``v̇ = (v_map − v) / powered``, the body's ``|v̇|`` at most the limit.

    Far from the speed that is commanded the current limit of the motor controller, or the grip of the tyres, determines
    the acceleration; near it the voltage that the motor induces does. At neutral ``v̇ = −v / coast``.
    """

    name: ClassVar[str] = "speed_lag_limited"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "torque of a direct-current motor under a current limit, and its speed-torque line beyond (Mohan, Undeland and "
        "Robbins 2003, Power electronics, chapter 13)"
    )
    limits: ClassVar[str] = (
        "where every change of speed is small it predicts the same as speed_lag, where all are large the same as "
        "speed_lag_coasting"
    )

    powered_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)
    acceleration_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    coast_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with half the library's lag, and the limit that takes the other half at a typical speed."""
        lag = max(fitted["accelerate_s"], _SHORTEST_S)
        return [(0.5 * lag, _TYPICAL_MPS / lag, fitted["brake_s"])]

    @staticmethod
    def aim(state: Floats, powered_s: float, acceleration_mps2: float, coast_s: float) -> None:
        """Set the lag and the limits of the powered drive, or the lag of the unpowered one."""
        if state[SPEED_AIM] == 0.0:
            state[BRAKE_LAG] = max(state[BRAKE_LAG], coast_s)
        else:
            state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG], powered_s)
            state[BRAKE_LAG] = max(state[BRAKE_LAG], powered_s)
            state[BODY_ACCELERATION_LIMIT] = min(state[BODY_ACCELERATION_LIMIT], acceleration_mps2)
            state[BODY_BRAKING_LIMIT] = min(state[BODY_BRAKING_LIMIT], acceleration_mps2)
