"""Empirical terms: shapes for what no effect of the library explains, simulated and fitted like effects.

They name no cause. Each says on which ``covariates`` the residual depends, the first of them first, and through what.
They are shapes (a disc, a line, an exponential) and not tables, since a shape needs few numbers and so
predicts runs that it was not fitted to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import (
    DISTANCE,
    FORWARD,
    FRONT,
    FRONT_AIM,
    FRONT_BEFORE,
    FRONT_SPEED,
    HEADING,
    HOURS,
    LEFT,
    REAR,
    REAR_AIM,
    REAR_BEFORE,
    REAR_SPEED,
    SEEN_X,
    SEEN_Y,
    SPEED,
    TIME,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from agvbench.types import Floats

_EDGE_M = 0.015
_TURN = math.tau
_START_S = 0.1
_PER_ROOT = 1.0 / math.sqrt(math.tau)


@dataclass(frozen=True)
class EmpiricalTerm(Effect):
    """A shape without a cause: ``covariates`` says on what the residual depends, ``through`` what it acts."""

    relaxes: ClassVar[str] = "none: it stands for an unknown cause"
    reference: ClassVar[str] = "empirical"
    limits: ClassVar[str] = "describes, and explains nothing"
    covariates: ClassVar[tuple[str, ...]]
    through: ClassVar[str]


@dataclass(frozen=True)
class SpeedInDisc(EmpiricalTerm):
    """In a disc of the floor the vehicle is slower: ``v ← v (1 − loss)``, with an edge of some centimetres."""

    name: ClassVar[str] = "speed_in_disc"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "speed"
    local: ClassVar[bool] = True

    loss: float = parameter(unit="–", low=-1.0, high=0.9, scale=0.1)
    x_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
    y_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
    radius_m: float = parameter(unit="m", low=0.0, high=20.0, scale=0.3)

    @staticmethod
    def drive(state: Floats, loss: float, x_m: float, y_m: float, radius_m: float) -> None:
        """Slow both axles inside."""
        if loss != 0.0:
            inside = radius_m - math.hypot(state[X] - x_m, state[Y] - y_m)
            left = 1.0 - 0.5 * loss * (1.0 + math.tanh(inside / _EDGE_M))
            state[FRONT_SPEED] *= left
            state[REAR_SPEED] *= left


@dataclass(frozen=True)
class TurnAtLine(EmpiricalTerm):
    """A line on the floor turns what crosses it, one way across and the other way back."""

    name: ClassVar[str] = "turn_at_line"
    stage: ClassVar[Stage] = Stage.FLOOR
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "turning"
    local: ClassVar[bool] = True

    turn_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    place_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
    direction_rad: float = parameter(unit="rad", low=-2.0 * _TURN, high=2.0 * _TURN, scale=0.5)

    @staticmethod
    def drift(state: Floats, turn_rad: float, place_m: float, direction_rad: float) -> None:
        """Turn while the line is near, by as much as it is crossed."""
        if turn_rad != 0.0:
            c, s = math.cos(direction_rad), math.sin(direction_rad)
            beyond = (c * state[X] + s * state[Y] - place_m) / _EDGE_M
            across = c * state[X_RATE] + s * state[Y_RATE]
            state[YAW_RATE] += turn_rad * across * _PER_ROOT / _EDGE_M * math.exp(-0.5 * beyond * beyond)


@dataclass(frozen=True)
class BentPicture(EmpiricalTerm):
    """The cameras' scale changes with the square of the distance from a centre."""

    name: ClassVar[str] = "bent_picture"
    stage: ClassVar[Stage] = Stage.CAMERA
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "camera"

    per_m2: float = parameter(unit="1/m²", low=-0.05, high=0.05, scale=0.01)
    x_m: float = parameter(unit="m", low=-3.0, high=3.0, scale=0.5)
    y_m: float = parameter(unit="m", low=-3.0, high=3.0, scale=0.5)

    @staticmethod
    def see(state: Floats, per_m2: float, x_m: float, y_m: float) -> None:
        """Move what is seen away from the centre."""
        x, y = state[SEEN_X] - x_m, state[SEEN_Y] - y_m
        bend = per_m2 * (x * x + y * y)
        state[SEEN_X] += bend * x
        state[SEEN_Y] += bend * y


@dataclass(frozen=True)
class SpeedByHeading(EmpiricalTerm):
    """Speed depends on where the vehicle points: ``v ← v (1 + a cos ψ + b sin ψ)``."""

    name: ClassVar[str] = "speed_by_heading"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("heading_rad",)
    through: ClassVar[str] = "speed"
    local: ClassVar[bool] = True

    cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)

    @staticmethod
    def drive(state: Floats, cosine: float, sine: float) -> None:
        """Change the speed of both axles."""
        if cosine != 0.0 or sine != 0.0:
            left = 1.0 + cosine * math.cos(state[HEADING]) + sine * math.sin(state[HEADING])
            state[FRONT_SPEED] *= left
            state[REAR_SPEED] *= left


@dataclass(frozen=True)
class TurnByHeading(EmpiricalTerm):
    """The path bends by where the vehicle points: ``κ ← κ + a cos ψ + b sin ψ``."""

    name: ClassVar[str] = "turn_by_heading"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("heading_rad",)
    through: ClassVar[str] = "turning"
    local: ClassVar[bool] = True

    cosine: float = parameter(unit="1/m", low=-2.0, high=2.0, scale=0.02)
    sine: float = parameter(unit="1/m", low=-2.0, high=2.0, scale=0.02)

    @staticmethod
    def move(state: Floats, cosine: float, sine: float) -> None:
        """Turn with the way driven."""
        if cosine != 0.0 or sine != 0.0:
            bend = cosine * math.cos(state[HEADING]) + sine * math.sin(state[HEADING])
            state[YAW_RATE] += bend * state[FORWARD]


@dataclass(frozen=True)
class SpeedByRunTime(EmpiricalTerm):
    """Speed falls (or grows) within each run: ``v ← v (1 − share (1 − e^(−t/T)))``."""

    name: ClassVar[str] = "speed_by_run_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("time_in_run_s",)
    through: ClassVar[str] = "speed"
    local: ClassVar[bool] = True

    share: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    time_constant_s: float = parameter(unit="s", low=0.0, high=60.0, scale=2.0)

    @staticmethod
    def drive(state: Floats, share: float, time_constant_s: float) -> None:
        """Slow both axles by the time in the run."""
        if share != 0.0:
            left = 1.0 - share * (1.0 - math.exp(-max(state[TIME], 0.0) / max(time_constant_s, 0.05)))
            state[FRONT_SPEED] *= left
            state[REAR_SPEED] *= left


@dataclass(frozen=True)
class TwistAtStart(EmpiricalTerm):
    """As it begins to move the vehicle loses time and turns, the other way when it starts backward."""

    name: ClassVar[str] = "twist_at_start"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("time_in_run_s", "history")
    through: ClassVar[str] = "turning"
    local: ClassVar[bool] = True

    twist_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    lost_s: float = parameter(unit="s", low=0.0, high=0.8, scale=0.1)

    @staticmethod
    def move(state: Floats, twist_rad: float, lost_s: float) -> None:
        """Twist and hold back within the first centimetres, by which `lost_s` is lost."""
        if (twist_rad != 0.0 or lost_s != 0.0) and state[SPEED] != 0.0:
            since = state[DISTANCE] / (abs(state[SPEED]) * _START_S)
            if since < 40.0:
                held = 1.0 - math.exp(-lost_s / _START_S)
                rate = held / lost_s if lost_s > 1e-6 else 1.0 / _START_S
                near = math.exp(-since)
                state[FORWARD] *= 1.0 - held * near
                state[LEFT] *= 1.0 - held * near
                state[YAW_RATE] *= 1.0 - held * near
                state[YAW_RATE] += math.copysign(twist_rad * rate * near, state[SPEED])


@dataclass(frozen=True)
class SteeringByCampaignTime(EmpiricalTerm):
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
class TrimByCampaignTime(EmpiricalTerm):
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
class SteeringByDirection(EmpiricalTerm):
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
class SteeringByHistory(EmpiricalTerm):
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


@dataclass(frozen=True)
class WaveByDistance(EmpiricalTerm):
    """Speed and course swing with the way driven in the run, once per period."""

    name: ClassVar[str] = "wave_by_distance"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("distance_modulo_period_m",)
    through: ClassVar[str] = "speed and turning"
    local: ClassVar[bool] = True

    period_m: float = parameter(unit="m", low=0.0, high=10.0, scale=0.1)
    speed_cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    speed_sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    turn_cosine: float = parameter(unit="1/m", low=-5.0, high=5.0, scale=0.1)
    turn_sine: float = parameter(unit="1/m", low=-5.0, high=5.0, scale=0.1)

    @staticmethod
    def move(
        state: Floats, period_m: float, speed_cosine: float, speed_sine: float, turn_cosine: float, turn_sine: float
    ) -> None:
        """Swing."""
        if period_m > 0.0:
            angle = math.tau * state[DISTANCE] / period_m
            c, s = math.cos(angle), math.sin(angle)
            state[YAW_RATE] += (turn_cosine * c + turn_sine * s) * state[FORWARD]
            left = 1.0 + speed_cosine * c + speed_sine * s
            state[FORWARD] *= left
            state[LEFT] *= left


TERMS: tuple[type[EmpiricalTerm], ...] = (
    SpeedInDisc,
    TurnAtLine,
    BentPicture,
    SpeedByHeading,
    TurnByHeading,
    SpeedByRunTime,
    TwistAtStart,
    SteeringByCampaignTime,
    TrimByCampaignTime,
    SteeringByDirection,
    SteeringByHistory,
    WaveByDistance,
)
"""Every shape that is tried."""
