"""Discrepancy terms of the axle angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FRONT, FRONT_AIM, FRONT_BEFORE, HOURS, REAR, REAR_AIM, REAR_BEFORE, SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringByCampaignTime(DiscrepancyTerm):
    """The steering gain changes with time: ``δ ← δ (1 + gain (1 − e^(−h/T)))``, both axles."""

    name: ClassVar[str] = "steering_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("campaign_time_h",)
    through: ClassVar[str] = "steering"

    gain: float = parameter(unit="–", low=-0.7, high=1.0, scale=0.05)
    time_constant_h: float = parameter(unit="h", low=0.0, high=50.0, scale=0.4)

    @staticmethod
    def steer(state: Floats, gain: float, time_constant_h: float) -> None:
        """Scale both angles."""
        if gain != 0.0:
            factor = 1.0 + gain * (1.0 - math.exp(-state[HOURS] / max(time_constant_h, 0.01)))
            state[FRONT] *= factor
            state[REAR] *= factor


@dataclass(frozen=True)
class TrimByCampaignTime(DiscrepancyTerm):
    """The offset of the axle angles drifts with time: ``δ ← δ + rate · hours``."""

    name: ClassVar[str] = "trim_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("campaign_time_h",)
    through: ClassVar[str] = "steering"

    front_rad_per_h: float = parameter(unit="rad/h", low=-2.0, high=2.0, scale=0.02)
    rear_rad_per_h: float = parameter(unit="rad/h", low=-2.0, high=2.0, scale=0.02)

    @staticmethod
    def steer(state: Floats, front_rad_per_h: float, rear_rad_per_h: float) -> None:
        """Turn each axle in proportion to time."""
        state[FRONT] += front_rad_per_h * state[HOURS]
        state[REAR] += rear_rad_per_h * state[HOURS]


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
    """Axles stop short of their target by a share of the change of angle, the same for both axles.

    Few runs turn an axle back, and often only one of both: two shares would be poorly determined.
    """

    name: ClassVar[str] = "steering_by_history"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"

    share: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)

    @staticmethod
    def aim(state: Floats, share: float) -> None:
        """Reduce the change of both targets."""
        state[FRONT_AIM] -= share * (state[FRONT_AIM] - state[FRONT_BEFORE])
        state[REAR_AIM] -= share * (state[REAR_AIM] - state[REAR_BEFORE])
