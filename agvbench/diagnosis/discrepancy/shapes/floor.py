"""Shapes of what depends on the place on the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.regression import Columns, GroupedRegression
from agvbench.diagnosis.discrepancy.shapes.base import Evidence, Option, Shapes, Values
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.types import Floats

_SHARES_OF_STEP = (0.1, 0.3, 0.5, 0.7, 0.9)
_RADII_M = (0.2, 0.35, 0.5, 0.8)
_DISC_STEP, _LINE_STEP = 18, 40
_LINE_DIRECTIONS = 16
_STRIP_DIRECTIONS, _STRIP_STEP, _WIDTHS_M = 8, 16, (0.3, 0.6, 1.0, 1.6)
_BLUR_M, _SHARP_M, _BEST_LINES, _FINE_STEPS, _MIN_CROSSINGS = 0.1, 0.01, 4, 9, 5
_POINT_STEP, _CORES_M = 12, (0.1, 0.5, 2.0)
_CABLE_STEPS, _SLACKS_M = 9, (0.0, 0.3, 0.7, 1.2)


def floor_shapes(of: Evidence) -> Shapes:
    """Yield the terms of the floor, and of a cable to a point of the room."""
    yield terms.SpeedInDisc, _discs(of.rates)
    yield terms.SpeedInStrip, _strips(of.rates)
    yield terms.TurnAtLine, _lines(of.rates, of.regression)
    yield terms.DriftToPoint, _points(of.rates)
    yield terms.DriftByPlace, iter([(_drifts(of.rates, _quadratic(of.rates.middle)), Values())])
    yield terms.PullOfCable, _cables(of.rates)


def _discs(rates: Rates) -> Iterator[Option]:
    low, high = (f(rates.middle, axis=0) for f in (np.min, np.max))
    step = max(float(np.max(high - low)) / _DISC_STEP, 0.05)
    points = [(1.0 - s) * rates.begin[:, :2] + s * rates.end[:, :2] for s in _SHARES_OF_STEP]
    for x in np.arange(low[0], high[0] + step, step):
        for y in np.arange(low[1], high[1] + step, step):
            square = np.stack([(w[:, 0] - x) ** 2 + (w[:, 1] - y) ** 2 for w in points])
            for radius in _RADII_M:
                inside = np.mean(square < radius * radius, axis=0)
                if np.count_nonzero(inside) >= 10:
                    yield {0: -inside[:, None]}, Values(float(x), float(y), radius)


def _strips(rates: Rates) -> Iterator[Option]:
    points = [(1.0 - s) * rates.begin[:, :2] + s * rates.end[:, :2] for s in _SHARES_OF_STEP]
    for direction in np.arange(_STRIP_DIRECTIONS) * math.pi / _STRIP_DIRECTIONS:
        across = np.stack([point @ _normal(direction) for point in points])
        step = max(float(np.ptp(across)) / _STRIP_STEP, 0.05)
        for place in np.arange(np.min(across), np.max(across) + step, step):
            for width in _WIDTHS_M:
                inside = np.mean(np.abs(across - place) < 0.5 * width, axis=0)
                if np.count_nonzero(inside) >= 10:
                    yield {0: -inside[:, None]}, Values(float(place), float(direction), width)


def _points(rates: Rates) -> Iterator[Option]:
    low, high = (f(rates.middle, axis=0) for f in (np.min, np.max))
    step = max(float(np.max(high - low)) / _POINT_STEP, 0.05)
    for x in np.arange(low[0], high[0] + step, step):
        for y in np.arange(low[1], high[1] + step, step):
            way = np.array([x, y]) - rates.middle
            for core in _CORES_M:
                towards = way / np.sqrt(np.sum(way * way, axis=1, keepdims=True) + core * core)
                yield _drifts(rates, towards[:, :, None]), Values(float(x), float(y), core)


def _cables(rates: Rates) -> Iterator[Option]:
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    along = np.column_stack([np.cos(heading), np.sin(heading)])
    along *= (rates.covariates["direction"] / rates.covariates["speed_mps"])[:, None]
    low, high = (f(rates.middle, axis=0) for f in (np.min, np.max))
    for x in np.linspace(low[0], high[0], _CABLE_STEPS):
        for y in np.linspace(low[1], high[1], _CABLE_STEPS):
            away = rates.middle - np.array([x, y])
            distance = np.hypot(*away.T) + 1e-9
            outward = np.sum(away * along, axis=1) / distance
            for slack in _SLACKS_M:
                yield {0: (-np.maximum(distance - slack, 0.0) * outward)[:, None]}, Values(float(x), float(y), slack)


def _quadratic(place: Floats) -> Floats:
    """Return the velocities (n, 2, 12) of a quadratic field at each place (n, 2), for coefficients of one."""
    x, y = place.T
    shapes = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    velocities = np.zeros((len(place), 2, 2 * shapes.shape[1]))
    velocities[:, 0, : shapes.shape[1]] = velocities[:, 1, shapes.shape[1] :] = shapes
    return velocities


def _drifts(rates: Rates, velocity: Floats) -> Columns:
    """Return the regressors of velocities over the floor (n, 2, q) [m/s]."""
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    per = (rates.covariates["direction"] / rates.covariates["speed_mps"])[:, None]
    c, s = np.cos(heading)[:, None] * per, np.sin(heading)[:, None] * per
    x, y = velocity[:, 0], velocity[:, 1]
    return {0: c * x + s * y, 1: c * y - s * x}


def _lines(rates: Rates, regression: GroupedRegression) -> Iterator[Option]:
    """Yield lines that turn a crossing vehicle: blurred ones over the whole floor, then sharp ones near the best.

    A sharp line that is misplaced by a hand's breadth is crossed at other samples, and explains nothing.
    """
    coarse = []
    for direction in np.arange(_LINE_DIRECTIONS) * math.pi / _LINE_DIRECTIONS:
        low, high = (float(f(rates.begin[:, :2] @ _normal(direction))) for f in (np.min, np.max))
        for place in np.linspace(low, high, _LINE_STEP)[1:-1]:
            crossed = _crossed(rates, direction, place, _BLUR_M)
            if crossed is not None:
                coarse.append((regression.gain({2: crossed})[0], direction, place))
    best = sorted(coarse, reverse=True)[:_BEST_LINES]
    for _, direction, place in best:
        for rotated in direction + np.linspace(-1.0, 1.0, _FINE_STEPS) * 0.5 * math.pi / _LINE_DIRECTIONS:
            for moved in place + np.linspace(-1.0, 1.0, _FINE_STEPS) * _BLUR_M:
                crossed = _crossed(rates, rotated, moved, _SHARP_M)
                if crossed is not None:
                    yield {2: crossed}, Values(float(moved), float(rotated))


def _normal(direction: float) -> Floats:
    return np.array([math.cos(direction), math.sin(direction)])


def _crossed(rates: Rates, direction: float, place: float, blur_m: float) -> Floats | None:
    """Return the share of a line that each step crosses (n, 2), per metre; None if too few steps cross it.

    The first column has the sign of the crossing, the second has none.
    """
    before, after = ((p[:, :2] @ _normal(direction) - place) / blur_m for p in (rates.begin, rates.end))
    if np.count_nonzero((before > 0.0) != (after > 0.0)) < _MIN_CROSSINGS:
        return None
    part = 0.5 * (np.tanh(after) - np.tanh(before))
    return np.asarray(np.column_stack([part, np.abs(part)]) * (rates.covariates["direction"] / rates.weight)[:, None])
