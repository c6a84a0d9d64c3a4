"""Discrepancy terms of the path curvature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm, coordinate
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    DISTANCE,
    FORWARD,
    HEADING,
    LEFT,
    ROLLED,
    SPEED,
    SPEED_AIM,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from agvbench.types import Floats

_EDGE_M = 0.015
_EDGE_STEP_S = 0.025
_TURN = math.tau
_START_S = 0.1
_PER_ROOT = 1.0 / math.sqrt(math.tau)


@dataclass(frozen=True)
class TurnAtLine(DiscrepancyTerm):
    """A line on the floor turns a vehicle that crosses it.

    Opposite crossings turn it by ``turn_rad`` in opposite directions, and by ``same_rad`` in the same direction.
    """

    name: ClassVar[str] = "turn_at_line"
    stage: ClassVar[Stage] = Stage.FLOOR
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "turning"
    longest_step_s: ClassVar[float] = _EDGE_STEP_S

    turn_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    same_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    place_m: float = coordinate()
    direction_rad: float = parameter(unit="rad", low=-2.0 * _TURN, high=2.0 * _TURN, scale=0.5)

    @staticmethod
    def drift(state: Floats, turn_rad: float, same_rad: float, place_m: float, direction_rad: float) -> None:
        """Add a yaw rate near the line, in proportion to the crossing speed."""
        if turn_rad != 0.0 or same_rad != 0.0:
            c, s = math.cos(direction_rad), math.sin(direction_rad)
            beyond = (c * state[X] + s * state[Y] - place_m) / _EDGE_M
            across = c * state[X_RATE] + s * state[Y_RATE]
            turned = turn_rad * across + same_rad * abs(across)
            state[YAW_RATE] += turned * _PER_ROOT / _EDGE_M * math.exp(-0.5 * beyond * beyond)


@dataclass(frozen=True)
class TurnByHeading(DiscrepancyTerm):
    """The path curvature depends on the heading: ``κ ← κ + a cos ψ + b sin ψ``."""

    name: ClassVar[str] = "turn_by_heading"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("heading_rad",)
    through: ClassVar[str] = "turning"
    longest_step_s: ClassVar[float] = 0.1

    cosine: float = parameter(unit="1/m", low=-2.0, high=2.0, scale=0.02)
    sine: float = parameter(unit="1/m", low=-2.0, high=2.0, scale=0.02)

    @staticmethod
    def move(state: Floats, cosine: float, sine: float) -> None:
        """Add the curvature to the yaw rate."""
        if cosine != 0.0 or sine != 0.0:
            curvature = cosine * math.cos(state[HEADING]) + sine * math.sin(state[HEADING])
            state[YAW_RATE] += curvature * state[FORWARD]


@dataclass(frozen=True)
class TurnByDirection(DiscrepancyTerm):
    """The path of a differential vehicle bends to the same side forward and backward: ``ω ← ω + curvature |v|``.

    One of its motors is weaker in one direction.
    """

    name: ClassVar[str] = "turn_by_direction"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("direction",)
    through: ClassVar[str] = "turning"
    needs_differential: ClassVar[bool] = True

    curvature_per_m: float = parameter(unit="1/m", low=-2.0, high=2.0, scale=0.02)

    @staticmethod
    def move(state: Floats, curvature_per_m: float) -> None:
        """Add to the yaw rate."""
        if curvature_per_m != 0.0:
            state[YAW_RATE] += curvature_per_m * abs(state[FORWARD])


@dataclass(frozen=True)
class SlipByYawRate(DiscrepancyTerm):
    """The vehicle slides out of a turn, and turns less, the faster it turns.

    The lateral velocity changes by ``side_s`` times the lateral acceleration ``v ψ̇``, as with equal slip angles of both
    axles. The yaw rate is reduced by the share ``turn_s |ψ̇|``.
    """

    name: ClassVar[str] = "slip_by_yaw_rate"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("curvature_per_m", "speed_mps")
    through: ClassVar[str] = "drift"

    side_s: float = parameter(unit="s", low=-2.0, high=2.0, scale=0.1)
    turn_s: float = parameter(unit="s", low=-2.0, high=2.0, scale=0.1)

    @staticmethod
    def move(state: Floats, side_s: float, turn_s: float) -> None:
        """Add the lateral velocity, and reduce the yaw rate."""
        if side_s != 0.0 or turn_s != 0.0:
            state[LEFT] += side_s * state[FORWARD] * state[YAW_RATE]
            state[YAW_RATE] *= 1.0 - turn_s * abs(state[YAW_RATE])


@dataclass(frozen=True)
class TwistAtStart(DiscrepancyTerm):
    """At the start of motion the vehicle is delayed and turns.

    It turns by ``twist_rad`` with the sign of the driving direction, and by ``same_rad`` in the same direction always.
    """

    name: ClassVar[str] = "twist_at_start"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("time_in_run_s", "history")
    through: ClassVar[str] = "turning"
    for_windows: ClassVar[bool] = False
    longest_step_s: ClassVar[float] = 0.025

    twist_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    same_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    lost_s: float = parameter(unit="s", low=0.0, high=0.8, scale=0.1)

    @staticmethod
    def move(state: Floats, twist_rad: float, same_rad: float, lost_s: float) -> None:
        """Turn and slow down within the first centimetres, with a total delay of `lost_s`."""
        if (twist_rad != 0.0 or same_rad != 0.0 or lost_s != 0.0) and state[SPEED] != 0.0:
            since = state[DISTANCE] / (abs(state[SPEED]) * _START_S)
            if since < 40.0:
                held = 1.0 - math.exp(-lost_s / _START_S)
                rate = held / lost_s if lost_s > 1e-6 else 1.0 / _START_S
                near = math.exp(-since)
                state[FORWARD] *= 1.0 - held * near
                state[LEFT] *= 1.0 - held * near
                state[YAW_RATE] *= 1.0 - held * near
                state[YAW_RATE] += (same_rad + math.copysign(twist_rad, twist_rad * state[SPEED])) * rate * near


@dataclass(frozen=True)
class TurnWhileCoasting(DiscrepancyTerm):
    """The vehicle turns while it comes to rest at neutral: ``κ ← κ + curvature``, as with a brake on one side."""

    name: ClassVar[str] = "turn_while_coasting"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("speed_mps", "time_in_run_s")
    through: ClassVar[str] = "turning"
    for_windows: ClassVar[bool] = False

    curvature_per_m: float = parameter(unit="1/m", low=-50.0, high=50.0, scale=1.0)

    @staticmethod
    def move(state: Floats, curvature_per_m: float) -> None:
        """Add to the yaw rate while the drive is at neutral."""
        if state[SPEED_AIM] == 0.0:
            state[YAW_RATE] += curvature_per_m * state[FORWARD]


@dataclass(frozen=True)
class WaveByDistance(DiscrepancyTerm):
    """Speed, direction of motion and curvature vary periodically with the distance driven in the run.

    The distance decreases backward: a wheel that turns back passes the same angles in reverse order.
    """

    name: ClassVar[str] = "wave_by_distance"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("distance_modulo_period_m",)
    through: ClassVar[str] = "speed, lateral motion and turning"
    for_windows: ClassVar[bool] = False
    longest_step_s: ClassVar[float] = 0.05

    period_m: float = parameter(unit="m", low=0.0, high=10.0, scale=0.1)
    speed_cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    speed_sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    turn_cosine: float = parameter(unit="1/m", low=-5.0, high=5.0, scale=0.1)
    turn_sine: float = parameter(unit="1/m", low=-5.0, high=5.0, scale=0.1)
    side_cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.02)
    side_sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.02)

    @staticmethod
    def move(
        state: Floats,
        period_m: float,
        speed_cosine: float,
        speed_sine: float,
        turn_cosine: float,
        turn_sine: float,
        side_cosine: float,
        side_sine: float,
    ) -> None:
        """Modulate speed, lateral velocity and yaw rate."""
        if period_m > 0.0:
            angle = math.tau * state[ROLLED] / period_m
            c, s = math.cos(angle), math.sin(angle)
            side = (side_cosine * c + side_sine * s) * state[FORWARD]
            state[YAW_RATE] += (turn_cosine * c + turn_sine * s) * state[FORWARD]
            factor = 1.0 + speed_cosine * c + speed_sine * s
            state[FORWARD] *= factor
            state[LEFT] = factor * state[LEFT] + side
