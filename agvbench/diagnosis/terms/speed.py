"""Discrepancy terms of the speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FORWARD, FRONT_SPEED, HEADING, LEFT, REAR_SPEED, TIME, YAW_RATE, X, Y
from agvbench.types import Floats

_EDGE_M = 0.015
_EDGE_STEP_S = 0.025


@dataclass(frozen=True)
class SpeedInDisc(DiscrepancyTerm):
    """The vehicle is slower in a disc of the floor: ``v ← v (1 − loss)``, with an edge of some centimetres."""

    name: ClassVar[str] = "speed_in_disc"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = _EDGE_STEP_S

    loss: float = parameter(unit="–", low=-1.0, high=0.9, scale=0.1)
    x_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
    y_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
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
    place_m: float = parameter(unit="m", low=-50.0, high=50.0, scale=0.5)
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
