"""Regressors of terms that depend on campaign time: courses of time, and what each quantity changes in the residual."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.command_history import CommandHistory
from agvbench.diagnosis.discrepancy.regression import Columns, GroupedRegression
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.diagnosis.terms.campaign_time import AT_ONCE_H, LATEST_H, LONGEST_H
from agvbench.diagnosis.terms.campaign_time import course as course_at
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_TIME_CONSTANTS_H = (0.1, 0.2, 0.4, 0.8, 2.0, LONGEST_H)
_RESTARTED_H = (0.4, LONGEST_H)
_PARTS = 12
_FEW, _CHANGED_SHARE = 0.03, 0.05


@dataclass(frozen=True)
class Course:
    """A course of time with its parameters: ``share`` (n,) of the change at each residual rate."""

    share: Floats
    begins_h: float
    ends_h: float
    time_constant_h: float

    def values(self, coefficients: Floats) -> list[float]:
        """Return the parameters of a term: coefficients, then those of the course."""
        return [*coefficients.tolist(), self.begins_h, self.ends_h, self.time_constant_h]

    @classmethod
    def part(cls, hours: Floats, begins_h: float, ends_h: float) -> Course:
        """Return the course of a change that holds between two times."""
        return cls(((hours >= begins_h) & (hours < ends_h)).astype(np.float64), begins_h, ends_h, 0.0)


def exponentials(hours: Floats) -> Iterator[Course]:
    """Yield exponential courses from the beginning of the campaign, for times (n,) [h]."""
    for constant in _TIME_CONSTANTS_H:
        yield _restarted(hours, 0.0, constant)


def restarts(hours: Floats) -> Iterator[Course]:
    """Yield exponential courses that start over at a time of a coarse grid; none if the runs began at a few times."""
    for begin in _coarse_grid(hours)[:-1]:
        for constant in _RESTARTED_H:
            yield _restarted(hours, begin, constant)


def _restarted(hours: Floats, begins_h: float, time_constant_h: float) -> Course:
    since = np.where(hours >= begins_h, hours - begins_h, hours)
    return Course(-np.expm1(-since / time_constant_h), begins_h, LATEST_H, time_constant_h)


def coarse_parts(hours: Floats) -> Iterator[Course]:
    """Yield parts of the campaign with ends on a coarse grid; none if the runs began at a few times only."""
    for begin, end in combinations(_coarse_grid(hours), 2):
        yield Course.part(hours, begin, end)


def _coarse_grid(hours: Floats) -> list[float]:
    between = _between_runs(hours)
    if len(between) < _PARTS:
        return []
    at = np.unique(np.linspace(0, len(between) - 1, _PARTS + 1).round().astype(int)[1:])
    return [float(time) for time in between[at]]


def _between_runs(hours: Floats) -> Floats:
    """Return times between any two runs, and one after all of them [h]."""
    starts = np.unique(hours)
    return np.concatenate([0.5 * (starts[1:] + starts[:-1]), [LATEST_H]])


def _best_exponential(hours: Floats, gain_of: Callable[[Course], float]) -> Course | None:
    return max(exponentials(hours), key=gain_of)


def _best_part(hours: Floats, gain_of: Callable[[Course], float]) -> Course | None:
    """Return the part of the campaign with the largest gain: the best of a coarse grid, then between any two runs.

    The second search is local, and over one end at a time.
    """
    between = _between_runs(hours)
    if len(between) < _PARTS:
        return None

    def gain(ends: tuple[float, float]) -> float:
        return gain_of(Course.part(hours, *ends))

    best = max(((part.begins_h, part.ends_h) for part in coarse_parts(hours)), key=gain)
    near = len(between) // _PARTS + 1
    for end in (0, 1, 0):
        at = int(np.searchsorted(between, best[end]))
        moved = between[max(at - near, 0) : at + near].tolist()
        choices = [(one, best[1]) if end == 0 else (best[0], one) for one in moved]
        best = max([best, *(c for c in choices if c[0] < c[1])], key=gain)
    return Course.part(hours, *best)


def _best_restart(hours: Floats, gain_of: Callable[[Course], float]) -> Course | None:
    """Return the course that starts over with the largest gain: the best of a coarse grid, then between any two runs.

    A restart before the first or after the last runs is none.
    """
    best = max(restarts(hours), key=gain_of, default=None)
    if best is None:
        return None
    between = _between_runs(hours)
    near, at = len(between) // _PARTS + 1, int(np.searchsorted(between, best.begins_h))
    moved = between[max(at - near, 0) : min(at + near, len(between) - 1)].tolist()
    return max([best, *(_restarted(hours, begin, best.time_constant_h) for begin in moved)], key=gain_of)


def complement(values: Floats, hours: Floats) -> Floats | None:
    """Return the parameters (p,) of a step with the opposite change outside its part, or None if there are no such.

    Maps or effects that absorb a constant change cannot tell the two apart, but one of them may need no effect beside.
    `hours` (R,) are the times at which the runs began; a part that all but a few runs precede or follow has no end
    there.
    """
    *sizes, begins_h, ends_h, time_constant_h = values.tolist()
    opposite = [-size for size in sizes]
    if time_constant_h > AT_ONCE_H:
        return None
    if np.mean(hours < begins_h) < _FEW:
        return np.array([*opposite, ends_h, LATEST_H, 0.0])
    if np.mean(hours >= ends_h) < _FEW:
        return np.array([*opposite, 0.0, begins_h, 0.0])
    return None


def is_constant(values: Floats, hours: Floats) -> bool:
    """Return whether a term with parameters `values` (p,) has one size in all but a few of the runs.

    Then it is no change with time: it takes the place of an effect that holds all the time. `hours` (R,) are the times
    at which the runs began.
    """
    shares = np.array([course_at(hour, *values[-3:].tolist()) for hour in hours])
    return bool(np.mean(np.abs(shares - np.median(shares)) > _CHANGED_SHARE) < _FEW)


def columns_by_campaign_time(
    rates: Rates, history: CommandHistory, geometry: Geometry
) -> Iterator[tuple[type[DiscrepancyTerm], Columns]]:
    """Yield each term with what its full change adds to the residual rates, a column per parameter of the change."""
    c = rates.covariates
    one, zero, curvature = np.ones(len(rates.run)), np.zeros(len(rates.run)), c["curvature_per_m"]
    yield terms.SpeedByCampaignTime, {0: one[:, None]}
    steering = by_steering_gain(rates, history, geometry)
    yield terms.SteeringByCampaignTime, steering
    late_steering: Columns = {}
    if geometry.is_differential:
        yield terms.WheelsByCampaignTime, {0: one[:, None]} | steering
    else:
        yield terms.TrimByCampaignTime, by_axle_angles(one, one, history, geometry)
        late_steering = _by_steering_lag(rates, history, geometry)
        yield terms.SteeringLagByCampaignTime, late_steering
    heading = 0.5 * (rates.begin + rates.end)[:, 2]
    cos, sin = (c["direction"] / c["speed_mps"] * of(heading) for of in (np.cos, np.sin))
    yield terms.DriftByCampaignTime, {0: np.column_stack([cos, sin]), 1: np.column_stack([-sin, cos])}
    yield (
        terms.MarkersByCampaignTime,
        {0: np.column_stack([zero, -curvature, zero]), 1: np.column_stack([curvature, zero, -one])},
    )
    first = np.r_[True, np.diff(rates.run) != 0]
    before = np.where(first, 0.0, np.r_[0.0, c["speed_mps"][:-1]])
    gained = ((before - c["speed_mps"]) / rates.weight)[:, None]
    yield terms.ClockByCampaignTime, {0: gained} | late_steering
    yield terms.SpeedLagByCampaignTime, {0: gained}


def by_steering_gain(rates: Rates, history: CommandHistory, geometry: Geometry) -> Columns:
    """Return the lateral and curvature residuals by a share of both axle angles, or of a differential's yaw rate."""
    if geometry.is_differential:
        curvature = rates.covariates["curvature_per_m"][:, None]
        return {1: geometry.rear_axle_m * curvature, 2: curvature}
    return by_both_axles(np.arctan(history.tangent), history, geometry)


def _by_steering_lag(rates: Rates, history: CommandHistory, geometry: Geometry) -> Columns:
    """Return the lateral and curvature residuals by a lag of the servos [s], which acts after their commands."""
    changed = np.any(np.diff(history.levels[:, 1:], axis=0) != 0, axis=1) | (np.diff(rates.run) != 0)
    lost = np.r_[True, changed] * rates.covariates["speed_mps"] / rates.weight
    missing = (np.arctan(history.previous) - np.arctan(history.tangent)) * lost[:, None]
    return by_both_axles(missing, history, geometry)


def by_both_axles(change: Floats, history: CommandHistory, geometry: Geometry) -> Columns:
    """Return the lateral and curvature residuals by changes of both axle angles (n, 2) [rad] at once, one column."""
    by_axle = by_axle_angles(change[:, 0], change[:, 1], history, geometry)
    return {k: columns.sum(axis=1, keepdims=True) for k, columns in by_axle.items()}


def by_axle_angles(front: Floats, rear: Floats, history: CommandHistory, geometry: Geometry) -> Columns:
    """Return the lateral and curvature residuals by changes of the axle angles [rad], a column per axle."""
    slope = 1.0 + history.tangent**2
    f, r = front * slope[:, 0], rear * slope[:, 1]
    lf, lr, base = geometry.front_axle_m, geometry.rear_axle_m, geometry.wheelbase_m
    return {1: np.column_stack([lr * f, lf * r]) / base, 2: np.column_stack([f, -r]) / base}


def changes(
    rates: Rates, history: CommandHistory, geometry: Geometry, regression: GroupedRegression
) -> Iterator[tuple[type[DiscrepancyTerm], Columns, Course]]:
    """Yield each term that depends on campaign time with the best course of each kind, and its regressors."""
    hours = rates.covariates["campaign_time_h"]
    for term, columns in columns_by_campaign_time(rates, history, geometry):

        def over_time(course: Course, columns: Columns = columns) -> Columns:
            return {k: course.share[:, None] * c for k, c in columns.items()}

        for search in (_best_exponential, _best_part, _best_restart):
            best = search(hours, lambda course: regression.gain(over_time(course))[0])
            if best is not None:
                yield term, over_time(best), best
