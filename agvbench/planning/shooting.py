"""Shooting: change steering and durations as little as possible, so that a model with effects rests on the target.

Each leg that drives has its own change of the front angle, of the rear angle (of axles that steer) and of the logarithm
of its duration. The rest pose, as the camera sees it, gives three equations; what is free beyond them stays near the
plan. Speeds stay as planned, since a duration does what a speed would.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from agvbench.planning.leg import Leg
from agvbench.types import Floats, wrap_angle

HEADING_ARM_M = 0.5
"""A heading error counts as the position error that it makes at this distance [m]."""
_ANGLE_RAD, _LOG_DURATION = 0.05, 0.1
_LARGEST_TURN_RAD, _LARGEST_STRETCH = math.radians(20.0), math.log(3.0)
# How dear changes are beside errors: a change by one measure weighs as 0.1 mm, which leaves errors near a micrometre.
_DEAR_M = 1e-4
_STEP = 1e-2
_REACHED_M = 2e-4
_NEAR = 1.0
"""Changes of at most one measure are near the plan."""
# Play and dead bands can hide the steering's slopes at the plan; a few degrees off they show.
_ELSEWHERE_RAD = ((0.07, 0.07), (-0.07, -0.07), (0.07, -0.07), (-0.07, 0.07))

Range = tuple[float, float]
"""The smallest and the largest angle [rad] (yaw rate [rad/s]) of an axle."""
Ends = Callable[[Sequence[Sequence[Leg]]], Floats]
"""From several lists of legs to where each ends, shape (n, 3)."""


@dataclass(frozen=True)
class Shot:
    """Legs that end on the target as nearly as could be found; ``at_limits`` names what could change no further."""

    legs: tuple[Leg, ...]
    at_limits: tuple[str, ...]


@dataclass(frozen=True)
class _Knob:
    """What may be changed of one leg, in a measure in which a change of 1 is noticeable."""

    leg: int
    field: str
    low: float
    high: float
    name: str


def shoot(legs: Sequence[Leg], front: Range, rear: Range, target: tuple[float, ...], ends: Ends) -> Shot:
    """Return `legs` changed so that they end at `target`, or as near as their limits allow.

    Parameters
    ----------
    legs
        As planned.
    front, rear
        The smallest and the largest angle [rad] (yaw rate [rad/s]) to which each axle can be commanded.
    target
        x [m], y [m], heading [rad] in the start frame.
    ends
        Where legs end, by the model.
    """
    aim = np.array(target, dtype=np.float64)
    pieces = _divided(legs, front, rear)
    # On full circles every change returns to the start; a change of half of one does not.
    problems = [_ShootingProblem(each, _knobs(each, front, rear), aim, ends) for each in (pieces, _halved(pieces))]
    found = _search(problems)
    return Shot(tuple(found.problem.legs(found.changes)), () if found.reaches else found.problem.limits(found.changes))


@dataclass(frozen=True)
class _Found:
    """Changes of the legs of a problem, and how far from the target they end [m]."""

    problem: _ShootingProblem
    changes: Floats
    distance_m: float

    @property
    def reaches(self) -> bool:
        return self.distance_m <= _REACHED_M

    @property
    def largest(self) -> float:
        return float(np.abs(self.changes).max())


def _search(problems: Sequence[_ShootingProblem]) -> _Found:
    """Return the first changes found that reach the target near the plan, else the least, else those that come closest.

    Far from the plan is another way, on which it is not true what was learned near it. So the problem of finer legs is
    tried before any search from elsewhere, and taken where it needs a fifth of the changes or leaves half of the miss:
    single turns keep one steering angle.
    """
    tried: list[_Found] = []

    def price(found: _Found, value: float, handicap: float) -> float:
        return value if found.problem is problems[0] else handicap * value

    for elsewhere in ((0.0, 0.0), *_ELSEWHERE_RAD):
        for problem in problems:
            changes = problem.solve_from(*elsewhere)
            tried.append(_Found(problem, changes, problem.distance_m(changes)))
            if problem is problems[0] and tried[-1].reaches and tried[-1].largest <= _NEAR:
                return tried[-1]
        if reached := [found for found in tried if found.reaches]:
            return min(reached, key=lambda found: price(found, found.largest, 5.0))
    return min(tried, key=lambda found: price(found, found.distance_m, 2.0))


class _ShootingProblem:
    def __init__(self, legs: Sequence[Leg], knobs: Sequence[_Knob], target: Floats, ends: Ends) -> None:
        self._legs, self._knobs, self._target, self._ends = legs, knobs, target, ends
        self._bounds = np.array([k.low for k in knobs]), np.array([k.high for k in knobs])

    def solve_from(self, front_rad: float, rear_rad: float) -> Floats:
        """Return the changes that a search ends with that begins so far from the plan's steering."""
        offsets = {"front": front_rad / _ANGLE_RAD, "rear": rear_rad / _ANGLE_RAD}
        return self._solve(np.array([offsets.get(knob.field, 0.0) for knob in self._knobs]))

    def legs(self, u: Floats) -> list[Leg]:
        """Return the legs with the changes `u`."""
        return _changed(self._legs, self._knobs, u)

    def limits(self, u: Floats) -> tuple[str, ...]:
        """Return the names of what cannot be changed further."""
        low, high = self._bounds
        ended = np.minimum(u - low, high - u) < 1e-3 * np.maximum(high - low, 1e-9)
        return tuple(dict.fromkeys(knob.name for knob, end in zip(self._knobs, ended, strict=True) if end))

    def _solve(self, start: Floats) -> Floats:
        """Return the changes that a bounded trust-region search from `start` ends with."""
        from scipy.optimize import least_squares

        low, high = self._bounds
        found = least_squares(
            self._residual,
            np.clip(start, low, high),
            self._jacobian,
            bounds=(low, high),
            xtol=1e-9,
            ftol=1e-12,
            gtol=1e-14,
            max_nfev=40,
        )
        return np.asarray(found.x)

    def distance_m(self, u: Floats) -> float:
        """Return how far from the target the changes `u` end [m]."""
        return float(np.linalg.norm(self._errors_of(u[None, :])[0]))

    def _residual(self, u: Floats) -> Floats:
        return np.concatenate([self._errors_of(u[None, :])[0], _DEAR_M * u])

    def _jacobian(self, u: Floats) -> Floats:
        # Central differences, one-sided where a limit is near.
        low, high = self._bounds
        below, above = np.maximum(u - _STEP, low) - u, np.minimum(u + _STEP, high) - u
        errors = self._errors_of(u + np.vstack([np.diag(below), np.diag(above)]))
        slopes = (errors[len(u) :] - errors[: len(u)]) / (above - below)[:, None]
        return np.vstack([slopes.T, _DEAR_M * np.eye(len(u))])

    def _errors_of(self, changes: Floats) -> Floats:
        off = self._ends([_changed(self._legs, self._knobs, u) for u in changes]) - self._target
        off[:, 2] = [HEADING_ARM_M * wrap_angle(angle) for angle in off[:, 2]]
        return off


def _divided(legs: Sequence[Leg], front: Range, rear: Range) -> list[Leg]:
    """Return the legs, halved until there is enough to change about them for three equations."""
    pieces = list(legs)
    while len(_knobs(pieces, front, rear)) < 3:
        pieces = _halved(pieces)
    return pieces


def _halved(legs: Sequence[Leg]) -> list[Leg]:
    halves = ([leg] if leg.is_rest else [replace(leg, duration_s=0.5 * leg.duration_s)] * 2 for leg in legs)
    return [half for pair in halves for half in pair]


def _knobs(legs: Sequence[Leg], front: Range, rear: Range) -> list[_Knob]:
    knobs = []
    for i, leg in enumerate(legs):
        if leg.is_rest:
            continue
        for field, angle, axle, reach in (
            ("front", leg.front, "front", front),
            ("rear", leg.rear, "rear", rear),
        ):
            low, high = (limit - angle for limit in reach)
            if high > low:
                low, high = max(low, -_LARGEST_TURN_RAD), min(high, _LARGEST_TURN_RAD)
                ends = (min(low, 0.0) / _ANGLE_RAD, max(high, 0.0) / _ANGLE_RAD)
                knobs.append(_Knob(i, field, *ends, name=f"{axle} angle"))
        stretch = _LARGEST_STRETCH / _LOG_DURATION
        knobs.append(_Knob(i, "duration_s", -stretch, stretch, name="duration"))
    return knobs


def _changed(legs: Sequence[Leg], knobs: Sequence[_Knob], u: Floats) -> list[Leg]:
    """Return the legs with the changes `u`; a rest has the steering of the leg that it was planned for."""
    out = list(legs)
    for knob, value in zip(knobs, u.tolist(), strict=True):
        leg = out[knob.leg]
        if knob.field == "duration_s":
            out[knob.leg] = replace(leg, duration_s=leg.duration_s * math.exp(_LOG_DURATION * value))
        elif knob.field == "front":
            out[knob.leg] = replace(leg, front=leg.front + _ANGLE_RAD * value)
        else:
            out[knob.leg] = replace(leg, rear=leg.rear + _ANGLE_RAD * value)
    for i, leg in enumerate(legs):
        if leg.is_rest:
            like = out[_served(legs, i)]
            out[i] = replace(leg, front=like.front, rear=like.rear)
    return out


def _served(legs: Sequence[Leg], rest: int) -> int:
    """Return the leg whose steering is set during a rest: the next that drives with it, else the last one."""
    angles = legs[rest].front, legs[rest].rear
    following = next((i for i in range(rest, len(legs)) if not legs[i].is_rest), None)
    if following is not None and (legs[following].front, legs[following].rear) == angles:
        return following
    before = next((i for i in range(rest, -1, -1) if not legs[i].is_rest), following)
    assert before is not None  # noqa: S101 - some leg drives, else there is no plan
    return before
