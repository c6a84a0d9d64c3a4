"""Discrepancy terms of the speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm, coordinate, decayed
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    DRIVE_HELD,
    DRIVE_LOAD,
    DRIVE_LOAD_AT,
    DRIVE_REVERSED,
    FORWARD,
    FRONT,
    FRONT_AIM,
    FRONT_MOVED_TO,
    FRONT_SPEED,
    HEADING,
    LEFT,
    REAR,
    REAR_AIM,
    REAR_MOVED_TO,
    REAR_SPEED,
    SPEED_AIM,
    STEERING_LOAD,
    STEERING_LOAD_AT,
    TIME,
    YAW_RATE,
    X,
    Y,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats

_EDGE_M = 0.015
_EDGE_STEP_S = 0.025
_PAUSE_ENDS_S = 0.02


@dataclass(frozen=True)
class SpeedInDisc(DiscrepancyTerm):
    """The vehicle is slower in a disc of the floor: ``v ← v (1 − loss)``, with an edge of some centimetres."""

    name: ClassVar[str] = "speed_in_disc"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = _EDGE_STEP_S

    loss: float = parameter(unit="–", low=-1.0, high=0.9, scale=0.1)
    x_m: float = coordinate()
    y_m: float = coordinate()
    radius_m: float = parameter(unit="m", low=0.0, high=20.0, scale=0.3)

    @staticmethod
    def drive(state: Floats, loss: float, x_m: float, y_m: float, radius_m: float) -> None:
        """Slow both axles inside."""
        if loss != 0.0:
            inside = radius_m - math.hypot(state[X] - x_m, state[Y] - y_m)
            factor = 1.0 - 0.5 * loss * (1.0 + math.tanh(inside / _EDGE_M))
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class SpeedInStrip(DiscrepancyTerm):
    """The vehicle is slower in a strip of the floor, such as a carpet: ``v ← v (1 − loss)``, edges as of the disc.

    The normal of the strip has direction ``direction_rad``; its centre line is ``place_m`` from the origin.
    """

    name: ClassVar[str] = "speed_in_strip"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = _EDGE_STEP_S

    loss: float = parameter(unit="–", low=-1.0, high=0.9, scale=0.1)
    place_m: float = coordinate()
    direction_rad: float = parameter(unit="rad", low=-math.tau, high=math.tau, scale=0.3)
    width_m: float = parameter(unit="m", low=0.0, high=20.0, scale=0.3)

    @staticmethod
    def drive(state: Floats, loss: float, place_m: float, direction_rad: float, width_m: float) -> None:
        """Slow both axles inside."""
        if loss != 0.0:
            across = state[X] * math.cos(direction_rad) + state[Y] * math.sin(direction_rad) - place_m
            factor = 1.0 - 0.5 * loss * (1.0 + math.tanh((0.5 * width_m - abs(across)) / _EDGE_M))
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class SpeedByHeading(DiscrepancyTerm):
    """The speed depends on the heading: ``v ← v (1 + a cos ψ + b sin ψ)``."""

    name: ClassVar[str] = "speed_by_heading"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("heading_rad",)
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = 0.1

    cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)

    @staticmethod
    def drive(state: Floats, cosine: float, sine: float) -> None:
        """Change the speed of both axles."""
        if cosine != 0.0 or sine != 0.0:
            factor = 1.0 + cosine * math.cos(state[HEADING]) + sine * math.sin(state[HEADING])
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class SpeedByCourse(DiscrepancyTerm):
    """The speed depends on the direction of motion over the floor, χ: ``v ← v (1 + a cos χ + b sin χ)``.

    Backward, χ is opposite to the heading: a slope slows the same direction of motion either way.
    """

    name: ClassVar[str] = "speed_by_course"
    stage: ClassVar[Stage] = Stage.BODY
    covariates: ClassVar[tuple[str, ...]] = ("course_rad", "heading_rad")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = 0.1

    cosine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)
    sine: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.03)

    @staticmethod
    def move(state: Floats, cosine: float, sine: float) -> None:
        """Scale the motion of the body."""
        forward, left = state[FORWARD], state[LEFT]
        speed = math.sqrt(forward * forward + left * left)
        if (cosine != 0.0 or sine != 0.0) and speed > 0.0:
            c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
            along, across = c * forward - s * left, s * forward + c * left
            factor = 1.0 + (cosine * along + sine * across) / speed
            state[FORWARD] *= factor
            state[LEFT] *= factor
            state[YAW_RATE] *= factor


@dataclass(frozen=True)
class SpeedByRunTime(DiscrepancyTerm):
    """The speed decreases (or increases) within each run: ``v ← v (1 − share (1 − e^(−t/T)))``."""

    name: ClassVar[str] = "speed_by_run_time"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("time_in_run_s",)
    through: ClassVar[str] = "speed"
    for_windows: ClassVar[bool] = False
    longest_step_s: ClassVar[float] = 0.2

    share: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    # A shorter one would be a factor of every speed, which the map absorbs.
    time_constant_s: float = parameter(unit="s", low=0.3, high=60.0, scale=2.0, null=2.0)

    @staticmethod
    def drive(state: Floats, share: float, time_constant_s: float) -> None:
        """Slow both axles by the time in the run."""
        if share != 0.0:
            factor = 1.0 - share * (1.0 - math.exp(-max(state[TIME], 0.0) / max(time_constant_s, 0.05)))
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@compiled(inline=True)
def angle_beyond(angle_rad: float, from_rad: float, reach_rad: float) -> float:
    """Return 0 up to an angle, and what grows beyond it towards 1 within a reach."""
    return -math.expm1(-max(angle_rad - from_rad, 0.0) / reach_rad)


@dataclass(frozen=True)
class SpeedBySteering(DiscrepancyTerm):
    """Large angles of an axle slow the vehicle, those to the left and to the right by shares of their own.

    ``v ← v (1 − Σ loss (1 − e^(−(|δ| − from)/reach)))`` over the axles whose angle is larger than ``from_rad``: a wheel
    rubs, or a joint binds.
    """

    name: ClassVar[str] = "speed_by_steering"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("curvature_per_m",)
    through: ClassVar[str] = "speed"
    needs_steered_axles: ClassVar[bool] = True

    front_left: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    front_right: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    rear_left: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    rear_right: float = parameter(unit="–", low=-0.9, high=0.9, scale=0.05)
    from_rad: float = parameter(unit="rad", low=0.0, high=1.0, scale=0.1)
    # A longer reach would be a loss in proportion to the angle, whatever it is.
    reach_rad: float = parameter(unit="rad", low=0.01, high=1.0, scale=0.1, null=0.1)

    @staticmethod
    def drive(
        state: Floats,
        front_left: float,
        front_right: float,
        rear_left: float,
        rear_right: float,
        from_rad: float,
        reach_rad: float,
    ) -> None:
        """Slow both axles by the angle of each."""
        front, rear = state[FRONT], state[REAR]
        loss = (front_left if front > 0.0 else front_right) * angle_beyond(abs(front), from_rad, reach_rad)
        loss += (rear_left if rear > 0.0 else rear_right) * angle_beyond(abs(rear), from_rad, reach_rad)
        state[FRONT_SPEED] *= 1.0 - loss
        state[REAR_SPEED] *= 1.0 - loss


@dataclass(frozen=True)
class SpeedAfterSteering(DiscrepancyTerm):
    """The vehicle is slower after its servos have moved: ``v ← v (1 − loss L)``, with ``L̇ = |δ̇_f| + |δ̇_r| − L / T``.

    Servos and drive have the same supply, which recovers in the time T.
    """

    name: ClassVar[str] = "speed_after_steering"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("history", "time_in_run_s")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = 0.1
    needs_steered_axles: ClassVar[bool] = True

    loss_per_rad: float = parameter(unit="1/rad", low=-3.0, high=5.0, scale=0.1)
    time_constant_s: float = parameter(unit="s", low=0.05, high=20.0, scale=0.5, null=0.5)

    @staticmethod
    def aim(state: Floats, loss_per_rad: float, time_constant_s: float) -> None:
        """Add what both axles move to what is left of the load."""
        if loss_per_rad != 0.0:
            front, rear, now = state[FRONT_AIM], state[REAR_AIM], state[TIME]
            state[STEERING_LOAD] = decayed(state[STEERING_LOAD], now - state[STEERING_LOAD_AT], time_constant_s)
            state[STEERING_LOAD] += abs(front - state[FRONT_MOVED_TO]) + abs(rear - state[REAR_MOVED_TO])
            state[FRONT_MOVED_TO], state[REAR_MOVED_TO], state[STEERING_LOAD_AT] = front, rear, now

    @staticmethod
    def drive(state: Floats, loss_per_rad: float, time_constant_s: float) -> None:
        """Slow both axles by what is left of the load."""
        if loss_per_rad != 0.0:
            since_s = state[TIME] - state[STEERING_LOAD_AT]
            factor = 1.0 - loss_per_rad * decayed(state[STEERING_LOAD], since_s, time_constant_s)
            state[FRONT_SPEED] *= max(factor, 0.0)
            state[REAR_SPEED] *= max(factor, 0.0)


@compiled(inline=True)
def mean_after(mean: float, held: float, since_s: float, time_constant_s: float) -> float:
    """Return the mean of the last seconds of what was `held` since then, `since_s` seconds after the mean was known."""
    return held + decayed(mean - held, since_s, time_constant_s)


@dataclass(frozen=True)
class SpeedAfterDriving(DiscrepancyTerm):
    """The vehicle is slower the more it drove in the last seconds: ``v ← v (1 − loss u)``, with ``T u̇ = |v_map| − u``.

    A supply recovers at rest in the time T. A loss below 0 is a drive that warms up.
    """

    name: ClassVar[str] = "speed_after_driving"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("history", "time_in_run_s")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = 0.1

    loss_s_per_m: float = parameter(unit="s/m", low=-2.0, high=2.0, scale=0.1)
    # A shorter one would be the lag of a drive.
    time_constant_s: float = parameter(unit="s", low=0.15, high=60.0, scale=1.0, null=1.0)

    @staticmethod
    def aim(state: Floats, loss_s_per_m: float, time_constant_s: float) -> None:
        """Average the commanded speed until now."""
        if loss_s_per_m != 0.0:
            since_s = state[TIME] - state[DRIVE_LOAD_AT]
            state[DRIVE_LOAD] = mean_after(state[DRIVE_LOAD], state[DRIVE_HELD], since_s, time_constant_s)
            state[DRIVE_HELD], state[DRIVE_LOAD_AT] = abs(state[SPEED_AIM]), state[TIME]

    @staticmethod
    def drive(state: Floats, loss_s_per_m: float, time_constant_s: float) -> None:
        """Slow both axles in proportion to the average."""
        if loss_s_per_m != 0.0:
            since_s = state[TIME] - state[DRIVE_LOAD_AT]
            load = mean_after(state[DRIVE_LOAD], state[DRIVE_HELD], since_s, time_constant_s)
            factor = max(1.0 - loss_s_per_m * load, 0.0)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class PauseAtReversal(DiscrepancyTerm):
    """The drive pauses before it drives in the other direction: ``v ← 0`` for the time ``pause_s`` after a reversal.

    A speed controller brakes first, or the gears turn through their play. The end of the pause takes some hundredths of
    a second.
    """

    name: ClassVar[str] = "pause_at_reversal"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("history", "direction")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = _EDGE_STEP_S

    pause_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)

    @staticmethod
    def drive(state: Floats, pause_s: float) -> None:
        """Stop both axles after a reversal."""
        if pause_s > 0.0:
            ends = math.tanh((state[TIME] - state[DRIVE_REVERSED] - pause_s) / _PAUSE_ENDS_S)
            factor = 1.0 - (1.0 - ends) / (1.0 + math.tanh(pause_s / _PAUSE_ENDS_S))
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor
