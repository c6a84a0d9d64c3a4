"""Discrepancy terms of quantities that change during a campaign.

Each has the same course. With a time constant of up to 36 s a change holds between two times, with its full size.
Otherwise it approaches its full size exponentially since the campaign began, and starts over at the first of the two
times: with another battery, or after a pause in which something cooled. A time constant of some hours is a drift that
is linear within an evening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    ACCELERATE_LAG,
    BRAKE_LAG,
    FORWARD,
    FRONT,
    FRONT_SPEED,
    HEADING,
    HOURS,
    LEFT,
    REAR,
    REAR_SPEED,
    SEEN_HEADING,
    SEEN_X,
    SEEN_Y,
    STEERING_LAG,
    X_RATE,
    Y_RATE,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats

LONGEST_H = 6.0
"""Largest time constant: within an evening, slower changes have the same course."""
LATEST_H = 1e3
AT_ONCE_H = 0.01
"""Time constant up to which a change is a step."""
_MOVING_MPS = 0.003


@compiled(inline=True)
def course(hours: float, begins_h: float, ends_h: float, time_constant_h: float) -> float:
    """Return the share of a change at a time [h]: 0 before a step begins and after the change ended, 1 if complete."""
    has_begun = hours >= begins_h
    if hours >= ends_h:
        return 0.0
    # Forward differences by the time constant of a step must not see the runs before it change.
    if time_constant_h <= AT_ONCE_H:
        return 1.0 if has_begun else 0.0
    return 1.0 - math.exp((begins_h - hours if has_begun else -hours) / time_constant_h)


def _begin() -> Any:
    return parameter(unit="h", low=0.0, high=LATEST_H, scale=0.1, is_discrete=True)


def _end() -> Any:
    return parameter(unit="h", low=0.0, high=LATEST_H, scale=0.1, is_discrete=True)


def _time_constant() -> Any:
    return parameter(unit="h", low=0.0, high=LONGEST_H, scale=0.3)


@dataclass(frozen=True)
class ByCampaignTime(DiscrepancyTerm):
    """A term that depends on the time since the campaign began."""

    covariates: ClassVar[tuple[str, ...]] = ("campaign_time_h",)
    for_windows: ClassVar[bool] = False


@dataclass(frozen=True)
class SpeedByCampaignTime(ByCampaignTime):
    """The speed changes: ``v ← v (1 + change · course)``."""

    name: ClassVar[str] = "speed_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "speed"

    change: float = parameter(unit="–", low=-0.9, high=2.0, scale=0.05)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def drive(state: Floats, change: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Scale both axle speeds."""
        if change != 0.0:
            factor = 1.0 + change * course(state[HOURS], begins_h, ends_h, time_constant_h)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class SteeringByCampaignTime(ByCampaignTime):
    """The steering gain of both axles changes: ``δ ← δ (1 + gain · course)``."""

    name: ClassVar[str] = "steering_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "steering"

    gain: float = parameter(unit="–", low=-0.9, high=2.0, scale=0.05)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def steer(state: Floats, gain: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Scale both angles."""
        if gain != 0.0:
            factor = 1.0 + gain * course(state[HOURS], begins_h, ends_h, time_constant_h)
            state[FRONT] *= factor
            state[REAR] *= factor


@dataclass(frozen=True)
class WheelsByCampaignTime(ByCampaignTime):
    """Both wheels of a differential vehicle change alike: ``v ← v (1 + change · course)``, and so ω.

    One example is a battery that is changed, without a controller of the yaw rate.
    """

    name: ClassVar[str] = "wheels_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "speed and turning"
    needs_differential: ClassVar[bool] = True

    change: float = parameter(unit="–", low=-0.9, high=2.0, scale=0.05)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def steer(state: Floats, change: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Scale the yaw rate."""
        state[FRONT] *= 1.0 + change * course(state[HOURS], begins_h, ends_h, time_constant_h)

    @staticmethod
    def drive(state: Floats, change: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Scale the speed."""
        factor = 1.0 + change * course(state[HOURS], begins_h, ends_h, time_constant_h)
        state[FRONT_SPEED] *= factor
        state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class TrimByCampaignTime(ByCampaignTime):
    """The offset of the axle angles changes: ``δ ← δ + angle · course``."""

    name: ClassVar[str] = "trim_by_campaign_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "steering"

    front_rad: float = parameter(unit="rad", low=-1.0, high=1.0, scale=0.02)
    rear_rad: float = parameter(unit="rad", low=-1.0, high=1.0, scale=0.02)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def steer(
        state: Floats, front_rad: float, rear_rad: float, begins_h: float, ends_h: float, time_constant_h: float
    ) -> None:
        """Turn both axles."""
        if front_rad != 0.0 or rear_rad != 0.0:
            share = course(state[HOURS], begins_h, ends_h, time_constant_h)
            state[FRONT] += front_rad * share
            state[REAR] += rear_rad * share


@dataclass(frozen=True)
class SteeringLagByCampaignTime(ByCampaignTime):
    """The lag of the servos changes, as grease that warms up: ``T ← T + change · course``, and never below zero."""

    name: ClassVar[str] = "steering_lag_by_campaign_time"
    stage: ClassVar[Stage] = Stage.SERVO
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    change_s: float = parameter(unit="s", low=-5.0, high=5.0, scale=0.1)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def aim(state: Floats, change_s: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Add to the lag of the servos."""
        change = change_s * course(state[HOURS], begins_h, ends_h, time_constant_h)
        state[STEERING_LAG] = max(state[STEERING_LAG] + change, 0.0)


@dataclass(frozen=True)
class SpeedLagByCampaignTime(ByCampaignTime):
    """The lags of the drive change alike: ``T ← T + change · course``, and never below zero."""

    name: ClassVar[str] = "speed_lag_by_campaign_time"
    stage: ClassVar[Stage] = Stage.SERVO
    through: ClassVar[str] = "speed"

    change_s: float = parameter(unit="s", low=-5.0, high=5.0, scale=0.1)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def aim(state: Floats, change_s: float, begins_h: float, ends_h: float, time_constant_h: float) -> None:
        """Add to both lags of the drive."""
        change = change_s * course(state[HOURS], begins_h, ends_h, time_constant_h)
        state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG] + change, 0.0)
        state[BRAKE_LAG] = max(state[BRAKE_LAG] + change, 0.0)


@dataclass(frozen=True)
class DriftByCampaignTime(ByCampaignTime):
    """A drift of the moving vehicle over the floor changes, such as a wind: a velocity in the floor frame · course.

    Moving has the meaning of `agvbench.effects.ground.floor_tilt.FloorTilt`.
    """

    name: ClassVar[str] = "drift_by_campaign_time"
    stage: ClassVar[Stage] = Stage.FLOOR
    through: ClassVar[str] = "drift"

    x_mps: float = parameter(unit="m/s", low=-0.3, high=0.3, scale=0.005)
    y_mps: float = parameter(unit="m/s", low=-0.3, high=0.3, scale=0.005)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def drift(
        state: Floats, x_mps: float, y_mps: float, begins_h: float, ends_h: float, time_constant_h: float
    ) -> None:
        """Add the velocity while moving."""
        if x_mps != 0.0 or y_mps != 0.0:
            square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
            moving = -math.expm1(-square / _MOVING_MPS**2)
            share = moving * course(state[HOURS], begins_h, ends_h, time_constant_h)
            state[X_RATE] += x_mps * share
            state[Y_RATE] += y_mps * share


@dataclass(frozen=True)
class MarkersByCampaignTime(ByCampaignTime):
    """The markers move on the vehicle: the measured pose is displaced by (forward, left, angle) · course."""

    name: ClassVar[str] = "markers_by_campaign_time"
    stage: ClassVar[Stage] = Stage.CAMERA
    through: ClassVar[str] = "camera"

    forward_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)
    left_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)
    angle_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def see(
        state: Floats,
        forward_m: float,
        left_m: float,
        angle_rad: float,
        begins_h: float,
        ends_h: float,
        time_constant_h: float,
    ) -> None:
        """Displace the measured pose."""
        if forward_m != 0.0 or left_m != 0.0 or angle_rad != 0.0:
            share = course(state[HOURS], begins_h, ends_h, time_constant_h)
            c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
            state[SEEN_X] += share * (c * forward_m - s * left_m)
            state[SEEN_Y] += share * (s * forward_m + c * left_m)
            state[SEEN_HEADING] += share * angle_rad


@dataclass(frozen=True)
class ClockByCampaignTime(ByCampaignTime):
    """The camera's clock drifts against that of the commands: the pose stamped t was true at t − delay · course."""

    name: ClassVar[str] = "clock_by_campaign_time"
    stage: ClassVar[Stage] = Stage.CAMERA
    through: ClassVar[str] = "camera"

    delay_s: float = parameter(unit="s", low=-2.0, high=2.0, scale=0.05)
    begins_h: float = _begin()
    ends_h: float = _end()
    time_constant_h: float = _time_constant()

    @staticmethod
    def capture(
        state: Floats, time_s: float, delay_s: float, begins_h: float, ends_h: float, time_constant_h: float
    ) -> float:
        """Return the earlier time of the pose."""
        if delay_s == 0.0:
            return time_s
        return time_s - delay_s * course(state[HOURS], begins_h, ends_h, time_constant_h)
