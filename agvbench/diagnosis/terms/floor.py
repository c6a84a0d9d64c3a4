"""Discrepancy terms of the floor: velocities over it that the wheels do not cause, as fields over the place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm, coordinate
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    FORWARD,
    FRONT_SPEED,
    HEADING,
    LEFT,
    REAR_SPEED,
    SPEED,
    X_RATE,
    Y_RATE,
    X,
    Y,
)
from agvbench.types import Floats

_FIELD_STEP_S = 0.1
_MOVING_MPS = 0.003


@dataclass(frozen=True)
class DriftToPoint(DiscrepancyTerm):
    """The moving vehicle drifts towards a point of the room: ``mps · d / √(d² + core²)``, d the way to the point.

    Far away it has one speed; within ``core_m`` it falls in proportion to the distance. Moving has the meaning of
    `agvbench.effects.ground.floor_tilt.FloorTilt`.
    """

    name: ClassVar[str] = "drift_to_point"
    stage: ClassVar[Stage] = Stage.FLOOR
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "drift"
    longest_step_s: ClassVar[float] = _FIELD_STEP_S

    mps: float = parameter(unit="m/s", low=-0.3, high=0.3, scale=0.005)
    x_m: float = coordinate()
    y_m: float = coordinate()
    core_m: float = parameter(unit="m", low=0.0, high=20.0, scale=0.3)

    @staticmethod
    def drift(state: Floats, mps: float, x_m: float, y_m: float, core_m: float) -> None:
        """Add the velocity while moving."""
        if mps != 0.0:
            square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
            to_x, to_y = x_m - state[X], y_m - state[Y]
            away = math.sqrt(to_x * to_x + to_y * to_y + core_m * core_m) + 1e-6
            share = -math.expm1(-square / _MOVING_MPS**2) * mps / away
            state[X_RATE] += share * to_x
            state[Y_RATE] += share * to_y


def _velocity() -> Any:
    return parameter(unit="m/s", low=-0.3, high=0.3, scale=0.005)


def _slope() -> Any:
    return parameter(unit="1/s", low=-0.3, high=0.3, scale=0.005)


def _bend() -> Any:
    return parameter(unit="1/(m s)", low=-0.3, high=0.3, scale=0.003)


@dataclass(frozen=True)
class DriftByPlace(DiscrepancyTerm):
    """The moving vehicle drifts with a velocity that is a quadratic function of the place, such as on a bent floor.

    Components along ``x`` and ``y`` of the floor: constant, ``_x``, ``_y``, ``_xx``, ``_xy``, ``_yy``. The constant
    belongs to the field: a `floor_tilt` beside it would be its value at an arbitrary origin.
    """

    name: ClassVar[str] = "drift_by_place"
    stage: ClassVar[Stage] = Stage.FLOOR
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "drift"
    longest_step_s: ClassVar[float] = _FIELD_STEP_S

    x: float = _velocity()
    x_x: float = _slope()
    x_y: float = _slope()
    x_xx: float = _bend()
    x_xy: float = _bend()
    x_yy: float = _bend()
    y: float = _velocity()
    y_x: float = _slope()
    y_y: float = _slope()
    y_xx: float = _bend()
    y_xy: float = _bend()
    y_yy: float = _bend()

    @staticmethod
    def drift(
        state: Floats, x: float, x_x: float, x_y: float, x_xx: float, x_xy: float, x_yy: float,
        y: float, y_x: float, y_y: float, y_xx: float, y_xy: float, y_yy: float,
    ) -> None:  # fmt: skip
        """Add the velocity while moving."""
        square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
        if square > 0.0:
            east, north = state[X], state[Y]
            moving = -math.expm1(-square / _MOVING_MPS**2)
            along = x + x_x * east + x_y * north + x_xx * east * east + x_xy * east * north + x_yy * north * north
            across = y + y_x * east + y_y * north + y_xx * east * east + y_xy * east * north + y_yy * north * north
            state[X_RATE] += moving * along
            state[Y_RATE] += moving * across


@dataclass(frozen=True)
class PullOfCable(DiscrepancyTerm):
    """A cable to a point brakes on the way out and helps on the way in: ``v ← v − slope max(d − slack, 0) cos α``.

    The distance to the point is d, and α is the angle between the heading and the direction away from it.
    """

    name: ClassVar[str] = "pull_of_cable"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m", "course_rad")
    through: ClassVar[str] = "speed"
    longest_step_s: ClassVar[float] = _FIELD_STEP_S

    per_s: float = parameter(unit="1/s", low=-1.0, high=1.0, scale=0.05)
    x_m: float = coordinate()
    y_m: float = coordinate()
    slack_m: float = parameter(unit="m", low=0.0, high=20.0, scale=0.3)

    @staticmethod
    def drive(state: Floats, per_s: float, x_m: float, y_m: float, slack_m: float) -> None:
        """Change the speed of both axles while the drive turns."""
        if per_s != 0.0 and state[SPEED] != 0.0:
            away_x, away_y = state[X] - x_m, state[Y] - y_m
            distance = math.hypot(away_x, away_y) + 1e-6
            outward = (away_x * math.cos(state[HEADING]) + away_y * math.sin(state[HEADING])) / distance
            pull = per_s * max(distance - slack_m, 0.0) * outward
            state[FRONT_SPEED] -= pull
            state[REAR_SPEED] -= pull
