"""Shapes of angles that are not what commands make them."""

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
    """Steering changes as hours pass: ``δ ← δ (1 + gain (1 − e^(−h/T)))``, both axles."""

    name: ClassVar[str] = "steering_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("campaign_time_h",)
    through: ClassVar[str] = "steering"

    gain: float = parameter(unit="–", low=-0.7, high=1.0, scale=0.05)
    time_constant_h: float = parameter(unit="h", low=0.0, high=50.0, scale=0.4)

    @staticmethod
    def steer(state: Floats, gain: float, time_constant_h: float) -> None:
        """Turn both axles further."""
        if gain != 0.0:
            more = 1.0 + gain * (1.0 - math.exp(-state[HOURS] / max(time_constant_h, 0.01)))
            state[FRONT] *= more
            state[REAR] *= more


@dataclass(frozen=True)
class TrimByCampaignTime(DiscrepancyTerm):
    """Where axles point drifts as hours pass: ``δ ← δ + rate · hours``."""

    name: ClassVar[str] = "trim_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("campaign_time_h",)
    through: ClassVar[str] = "steering"

    front_rad_per_h: float = parameter(unit="rad/h", low=-2.0, high=2.0, scale=0.02)
    rear_rad_per_h: float = parameter(unit="rad/h", low=-2.0, high=2.0, scale=0.02)

    @staticmethod
    def steer(state: Floats, front_rad_per_h: float, rear_rad_per_h: float) -> None:
        """Turn each axle by the hours that have passed."""
        state[FRONT] += front_rad_per_h * state[HOURS]
        state[REAR] += rear_rad_per_h * state[HOURS]


@dataclass(frozen=True)
class SteeringByDirection(DiscrepancyTerm):
    """Axles point one way driving forward, the other way driving backward: ``δ ← δ ± angle``."""

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
    """Axles stop short of where they are sent, by a share of the way from where they stood, the same for both.

    Few runs turn an axle back, and often one axle alone: two shares would leave the other's to chance.
    """

    name: ClassVar[str] = "steering_by_history"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"

    share: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)

    @staticmethod
    def aim(state: Floats, share: float) -> None:
        """Aim short."""
        state[FRONT_AIM] -= share * (state[FRONT_AIM] - state[FRONT_BEFORE])
        state[REAR_AIM] -= share * (state[REAR_AIM] - state[REAR_BEFORE])
