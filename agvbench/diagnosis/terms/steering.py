"""Discrepancy terms of the axle angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    FRONT,
    FRONT_AIM,
    FRONT_BEFORE,
    FRONT_REVERSAL,
    REAR,
    REAR_AIM,
    REAR_BEFORE,
    REAR_REVERSAL,
    SPEED,
)
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringByDirection(DiscrepancyTerm):
    """The offset of the axle angles has the sign of the driving direction: ``δ ← δ ± angle``."""

    name: ClassVar[str] = "steering_by_direction"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("direction",)
    through: ClassVar[str] = "steering"

    front_rad: float = parameter(unit="rad", low=-0.3, high=0.3, scale=0.02)
    rear_rad: float = parameter(unit="rad", low=-0.3, high=0.3, scale=0.02)

    @staticmethod
    def steer(state: Floats, front_rad: float, rear_rad: float) -> None:
        """Turn each axle with the sign of the speed."""
        if state[SPEED] != 0.0:
            state[FRONT] += math.copysign(front_rad, front_rad * state[SPEED])
            state[REAR] += math.copysign(rear_rad, rear_rad * state[SPEED])


@dataclass(frozen=True)
class SteeringByHistory(DiscrepancyTerm):
    """Axles stop short of their target by shares of a change of angle, the same for both axles.

    ``share`` is of the change since the previous command, ``since_reversal`` of that since the axle last reversed, as
    in hysteresis of a gear. Few runs turn an axle back, and often only one of both: shares by axle would be poorly
    determined.
    """

    name: ClassVar[str] = "steering_by_history"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"

    share: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)
    since_reversal: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)

    @staticmethod
    def aim(state: Floats, share: float, since_reversal: float) -> None:
        """Reduce the changes of both targets."""
        front, rear = state[FRONT_AIM], state[REAR_AIM]
        state[FRONT_AIM] -= share * (front - state[FRONT_BEFORE]) + since_reversal * (front - state[FRONT_REVERSAL])
        state[REAR_AIM] -= share * (rear - state[REAR_BEFORE]) + since_reversal * (rear - state[REAR_REVERSAL])
