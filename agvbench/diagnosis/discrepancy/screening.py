"""Which discrepancy terms are screened_terms, by linear regressions on residual rates over a grid of shapes.

A shape's numbers that are not linear (a place, a radius, a time constant) come from the grid; its sizes are those of
the regression.

Each option's sizes follow by least squares and are judged by groups of runs that they were not fitted to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis import terms
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.discrepancy.regression import FOLDS, Columns, GroupedRegression, SteeringTangents
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_ALONG_WAY = (0.1, 0.3, 0.5, 0.7, 0.9)
_RADII_M = (0.2, 0.35, 0.5, 0.8)
_DISC_STEP, _LINE_STEP = 18, 40
_LINE_DIRECTIONS = 16
_STRIP_DIRECTIONS, _STRIP_STEP, _WIDTHS_M = 8, 16, (0.3, 0.6, 1.0, 1.6)
_BLUR_M, _SHARP_M, _BEST_LINES, _FINE, _MIN_CROSSINGS = 0.1, 0.01, 4, 9, 5
_RUN_TIMES_S = (0.4, 0.8, 1.6, 3.2, 6.4)
_HOURS = (0.1, 0.2, 0.4, 0.8, 2.0)
_WAVES_M = np.geomspace(0.12, 1.5, 50)

Option = tuple[Columns, "Values"]


class Values:
    """Makes a term's values of what is linear and what came from the grid, in the term's own order."""

    def __init__(self, *fixed: float) -> None:
        self.fixed = fixed

    def __call__(self, sizes: Floats) -> list[float]:
        """Return the values: sizes, then the grid's."""
        return [*sizes.tolist(), *self.fixed]


class _Picture(Values):
    def __call__(self, sizes: Floats) -> list[float]:
        bend = float(sizes[0])
        limit = 3.0
        centre = [float(np.clip(s / bend, -limit, limit)) if bend else 0.0 for s in sizes[1:]]
        return [bend, *centre, 0.0, 0.0][:3]


class _Wave(Values):
    def __call__(self, sizes: Floats) -> list[float]:
        return [*self.fixed, *sizes.tolist()]


def options(
    rates: Rates, stands: SteeringTangents, geometry: Geometry, assess: GroupedRegression
) -> Iterator[tuple[type[terms.DiscrepancyTerm], Iterator[Option]]]:
    """Yield each term with its regressors and what makes values of their sizes."""
    c = rates.covariates
    sine = np.column_stack([np.cos(c["heading_rad"]), np.sin(c["heading_rad"])])
    yield terms.SpeedInDisc, _discs(rates)
    yield terms.SpeedInStrip, _strips(rates)
    yield terms.TurnAtLine, _lines(rates, assess)
    yield terms.BentPicture, _pictures(rates)
    yield terms.SpeedByHeading, iter([({0: sine}, Values())])
    yield terms.TurnByHeading, iter([({2: sine}, Values())])
    yield terms.SpeedByRunTime, _run_times(rates)
    yield terms.TwistAtStart, _starts(rates)
    yield terms.SteeringByCampaignTime, _campaign_times(rates, stands, geometry)
    hours, direction = c["campaign_time_h"], c["direction"]
    yield terms.TrimByCampaignTime, iter([(_axles(hours, hours, stands, geometry), Values())])
    yield terms.SteeringByDirection, iter([(_axles(direction, direction, stands, geometry), Values())])
    short = stands.before - stands.tangent
    angle = np.arctan(stands.before) - np.arctan(stands.tangent)
    if np.any(short != 0.0):
        both = _axles(angle[:, 0], angle[:, 1], stands, geometry)
        yield terms.SteeringByHistory, iter([({k: v.sum(axis=1, keepdims=True) for k, v in both.items()}, Values())])
    yield terms.WaveByDistance, _waves(rates)


def _axles(front: Floats, rear: Floats, stands: SteeringTangents, geometry: Geometry) -> Columns:
    """Return what turning each axle by these angles [rad] does, lateral and turning: a column per axle."""
    slope = 1.0 + stands.tangent**2
    f, r = front * slope[:, 0], rear * slope[:, 1]
    lf, lr, base = geometry.front_axle_m, geometry.rear_axle_m, geometry.wheelbase_m
    return {1: np.column_stack([lr * f, lf * r]) / base, 2: np.column_stack([f, -r]) / base}


def _campaign_times(rates: Rates, stands: SteeringTangents, geometry: Geometry) -> Iterator[Option]:
    angle = np.arctan(stands.tangent)
    for hours in _HOURS:
        warm = -np.expm1(-rates.covariates["campaign_time_h"] / hours)
        both = _axles(warm * angle[:, 0], warm * angle[:, 1], stands, geometry)
        yield {k: v.sum(axis=1, keepdims=True) for k, v in both.items()}, Values(hours)


def _run_times(rates: Rates) -> Iterator[Option]:
    for constant in _RUN_TIMES_S:
        column = np.expm1(-rates.covariates["time_in_run_s"] / constant)
        yield {0: column[:, None]}, Values(constant)


def _starts(rates: Rates) -> Iterator[Option]:
    first = np.r_[True, np.diff(rates.run) != 0] / rates.weight
    zero = np.zeros_like(first)
    lost = -first * rates.covariates["speed_mps"]
    yield {0: np.column_stack([zero, lost]), 2: np.column_stack([first, zero])}, Values()


def _waves(rates: Rates) -> Iterator[Option]:
    zero = np.zeros((len(rates.run), 2))
    for period in _WAVES_M:
        angle = math.tau * rates.covariates["distance_m"] / period
        wave = np.column_stack([np.cos(angle), np.sin(angle)])
        yield {0: np.hstack([wave, zero]), 2: np.hstack([zero, wave])}, _Wave(float(period))


def _discs(rates: Rates) -> Iterator[Option]:
    low, high = (f(rates.middle, axis=0) for f in (np.min, np.max))
    step = max(float(np.max(high - low)) / _DISC_STEP, 0.05)
    ways = [(1.0 - s) * rates.begin[:, :2] + s * rates.end[:, :2] for s in _ALONG_WAY]
    for x in np.arange(low[0], high[0] + step, step):
        for y in np.arange(low[1], high[1] + step, step):
            square = np.stack([(w[:, 0] - x) ** 2 + (w[:, 1] - y) ** 2 for w in ways])
            for radius in _RADII_M:
                inside = np.mean(square < radius * radius, axis=0)
                if np.count_nonzero(inside) >= 10:
                    yield {0: -inside[:, None]}, Values(float(x), float(y), radius)


def _strips(rates: Rates) -> Iterator[Option]:
    ways = [(1.0 - s) * rates.begin[:, :2] + s * rates.end[:, :2] for s in _ALONG_WAY]
    for direction in np.arange(_STRIP_DIRECTIONS) * math.pi / _STRIP_DIRECTIONS:
        across = np.stack([way @ _across(direction) for way in ways])
        step = max(float(np.ptp(across)) / _STRIP_STEP, 0.05)
        for place in np.arange(np.min(across), np.max(across) + step, step):
            for width in _WIDTHS_M:
                inside = np.mean(np.abs(across - place) < 0.5 * width, axis=0)
                if np.count_nonzero(inside) >= 10:
                    yield {0: -inside[:, None]}, Values(float(place), float(direction), width)


def _lines(rates: Rates, assess: GroupedRegression) -> Iterator[Option]:
    """Yield lines that turn what crosses them: blurred ones over the whole floor, then sharp ones near the best.

    A sharp line that is off by a hand's breadth is crossed at other samples, and explains nothing.
    """
    coarse = []
    for direction in np.arange(_LINE_DIRECTIONS) * math.pi / _LINE_DIRECTIONS:
        low, high = (float(f(rates.begin[:, :2] @ _across(direction))) for f in (np.min, np.max))
        for place in np.linspace(low, high, _LINE_STEP)[1:-1]:
            crossed = _crossed(rates, direction, place, _BLUR_M)
            if crossed is not None:
                coarse.append((assess.gain({2: crossed})[0], direction, place))
    best = sorted(coarse, reverse=True)[:_BEST_LINES]
    for _, direction, place in best:
        for turned in direction + np.linspace(-1.0, 1.0, _FINE) * 0.5 * math.pi / _LINE_DIRECTIONS:
            for moved in place + np.linspace(-1.0, 1.0, _FINE) * _BLUR_M:
                crossed = _crossed(rates, turned, moved, _SHARP_M)
                if crossed is not None:
                    yield {2: crossed}, Values(float(moved), float(turned))


def _across(direction: float) -> Floats:
    return np.array([math.cos(direction), math.sin(direction)])


def _crossed(rates: Rates, direction: float, place: float, blur_m: float) -> Floats | None:
    """Return by how much of a line each step crosses (n, 1), per metre; None where hardly any does."""
    before, after = ((p[:, :2] @ _across(direction) - place) / blur_m for p in (rates.begin, rates.end))
    if np.count_nonzero((before > 0.0) != (after > 0.0)) < _MIN_CROSSINGS:
        return None
    part = 0.5 * (np.tanh(after) - np.tanh(before))
    return np.asarray((part * rates.covariates["direction"] / rates.weight)[:, None])


def _pictures(rates: Rates) -> Iterator[Option]:
    def field(p: Floats) -> Floats:
        """Return displacements (3, n, 2): for the bend about the origin, and for its centre."""
        x, y = p[:, 0], p[:, 1]
        r2 = x * x + y * y
        bend = np.column_stack([r2 * x, r2 * y])
        return np.stack(
            [
                bend,
                np.column_stack([-2.0 * x * x - r2, -2.0 * x * y]),
                np.column_stack([-2.0 * x * y, -2.0 * y * y - r2]),
            ]
        )

    moved = field(rates.end) - field(rates.begin)
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    c, s = np.cos(heading), np.sin(heading)
    per = rates.covariates["direction"] / rates.weight
    along = (moved[..., 0] * c + moved[..., 1] * s) * per
    aside = (moved[..., 1] * c - moved[..., 0] * s) * per
    yield {0: along[:1].T, 1: aside[:1].T}, _Picture()
    yield {0: along.T, 1: aside.T}, _Picture()


_SMALL = 0.1


@dataclass(frozen=True)
class Start:
    """A term to try: values (2, p) to start a fit from, and its ``gain``, a log likelihood ratio on runs left out.

    The second row is the same shape at a tenth of its size: where each run's offsets have taken a cause up, they must
    give it back bit by bit.
    """

    term: type[DiscrepancyTerm]
    values: Floats
    gain: float


def screen(
    rates: Rates, stands: SteeringTangents, geometry: Geometry, group: NDArray[np.int64], seed: int
) -> list[Start]:
    """Return for each term its best start, the largest predicted gain first; terms without any are left out."""
    assess = GroupedRegression(rates, stands, folds(group, FOLDS, seed)[rates.run])
    found = []
    for term, shapes in options(rates, stands, geometry, assess):
        best: Start | None = None
        for columns, values in shapes:
            gain, sizes = assess.gain(columns)
            if gain > (best.gain if best else 0.0):
                best = Start(term, np.array([values(sizes), values(_SMALL * sizes)], dtype=np.float64), gain)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda start: -start.gain)
