"""End stops and dead bands as shapes of static maps, fitted to the nodal values under their covariance.

Shapes are compared by generalised least squares with a smooth shape of as many parameters. The standard error of every
value includes a share of the range as model error, because no real map is exactly linear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats
from agvbench.vehicle.maps import StaticMap

_MODEL_ERROR = 0.002
_MIN_GAIN = 12.0
_PER_PARAMETER = 2.0
_MIN_SHORT = 0.015
_SIGNIFICANCE = 4.0
_MIN_INSIDE = 3
_MAX_SHARE_AT_STOP = 0.4
_MAX_STDERR_RAD = 0.1
_WIDTHS = 60
_MAX_LEVELS = 5
_SATURATIONS = np.geomspace(0.1, 4.0, 10)


@dataclass(frozen=True)
class RefittedMap:
    """Nodal ``values`` (n,) of a map at its ``commands`` (n,), ascending, with their ``covariance`` (n, n)."""

    commands: Floats
    values: Floats
    covariance: Floats

    @cached_property
    def size(self) -> float:
        """The range of values."""
        return float(np.ptp(self.values))

    @cached_property
    def root(self) -> Floats:
        """The whitening matrix of the values (n, n): a square root of the inverse covariance with model error."""
        whole = self.covariance + np.eye(len(self.values)) * (_MODEL_ERROR * self.size) ** 2
        return np.asarray(np.linalg.cholesky(np.linalg.inv(whole)).T)

    def agrees_with(self, prior_model: StaticMap) -> bool:
        """Return whether a map agrees with the values within their errors (χ² test)."""
        whitened = self.root @ (self.values - np.asarray(prior_model(self.commands)))
        count = len(self.values)
        return float(whitened @ whitened) <= count + _SIGNIFICANCE * math.sqrt(2.0 * count)

    def select(self, chosen: NDArray[np.int64]) -> RefittedMap:
        """Return the part of the map with the `chosen` indices, with its marginal covariance."""
        return RefittedMap(self.commands[chosen], self.values[chosen], self.covariance[np.ix_(chosen, chosen)])

    def fit(self, basis: Floats) -> tuple[float, Floats, Floats]:
        """Return χ² of the best fit of `basis` (n, p), its coefficients (p,) and their standard errors (p,)."""
        left, right = self.root @ basis, self.root @ self.values
        coefficients = np.asarray(np.linalg.lstsq(left, right, rcond=1e-12)[0], dtype=np.float64)
        errors = np.sqrt(np.diagonal(np.linalg.pinv(left.T @ left, hermitian=True)))
        return float(np.sum((right - left @ coefficients) ** 2)), coefficients, np.asarray(errors, dtype=np.float64)


@dataclass(frozen=True)
class EndStops:
    """Lowest and highest output with standard errors, NaN without a stop; ``gain``: reduction of χ²."""

    low: tuple[float, float]
    high: tuple[float, float]
    gain: float
    rising: bool


def end_stops(refitted: RefittedMap, prior_model: StaticMap) -> EndStops | None:
    """Return the end stops of a steering map; None if a line or a smooth curve describes it as well.

    Between the stops the shape is the nominal map, scaled and shifted.
    """
    known = np.flatnonzero(np.sqrt(np.diagonal(refitted.covariance)) < _MAX_STDERR_RAD)
    own = refitted.select(known)
    inner = np.asarray(prior_model(own.commands))
    if len(known) < _MIN_INSIDE + 1 or np.ptp(inner) == 0.0:
        return None
    rising = bool(np.polyfit(own.commands, own.values, 1)[0] > 0.0)
    inner = (inner - inner.mean()) / float(np.ptp(inner))
    free = own.fit(np.vander(inner, 2))[0]
    best, misfit = None, free
    most = int(_MAX_SHARE_AT_STOP * len(known))
    for first, last in product(range(most + 1), repeat=2):
        if not first + last or len(known) - first - last < _MIN_INSIDE:
            continue
        fitted = _with_stops(own, inner, first, last)
        if fitted is not None and fitted[0] + _MIN_GAIN * ((first > 0) + (last > 0)) < misfit:
            best, misfit = (fitted, first, last), fitted[0] + _MIN_GAIN * ((first > 0) + (last > 0))
    if best is None:
        return None
    (chi, coefficients, errors), first, last = best
    smooth = own.fit(np.vander(inner, min(4, len(known))))[0] + _PER_PARAMETER * 4
    if chi + _PER_PARAMETER * len(coefficients) > smooth:
        return None
    ends = [(float(v), float(e)) for v, e in zip(coefficients[2:], errors[2:], strict=True)]
    none = (math.nan, math.nan)
    at_first = ends[0] if first else none
    at_last = ends[-1] if last else none
    low, high = (at_first, at_last) if rising else (at_last, at_first)
    return EndStops(low, high, free - chi, rising)


def _with_stops(own: RefittedMap, inner: Floats, first: int, last: int) -> tuple[float, Floats, Floats] | None:
    """Fit a line with the first and last values at a stop; None if the line does not extend beyond the stop."""
    count = len(inner)
    basis = np.zeros((count, 2 + (first > 0) + (last > 0)))
    basis[:, :2] = np.vander(inner, 2)
    for column, at in ((2, slice(0, first)), (basis.shape[1] - 1, slice(count - last, count))):
        if at.stop > at.start:
            basis[at] = 0.0
            basis[at, column] = 1.0
    chi, coefficients, errors = own.fit(basis)
    line = np.vander(inner, 2) @ coefficients[:2]
    up = math.copysign(1.0, line[-1] - line[0])
    for column, outermost, innermost, side in (
        (2, 0, first, -up),
        (basis.shape[1] - 1, count - 1, count - 1 - last, up),
    ):
        if innermost == outermost:
            continue
        short = side * (line[outermost] - coefficients[column])
        # At the innermost command the line is below the stop, at the outermost one clearly beyond it.
        inside = side * (coefficients[column] - line[innermost])
        if (
            short < max(_MIN_SHORT * own.size, _SIGNIFICANCE * float(errors[column]))
            or inside < -_MODEL_ERROR * own.size
        ):
            return None
    return chi, coefficients, errors


@dataclass(frozen=True)
class DeadBand:
    """Half ``width`` of the dead band, its ``stderr``, and the ``gain`` in χ²."""

    width: float
    stderr: float
    gain: float


def dead_band(refitted: RefittedMap, prior_model: StaticMap, neutral: float) -> DeadBand | None:
    """Return the dead band of the drive about neutral, or None.

    Each side has its own edge, because a shift of neutral alone is no dead band. The width is the mean of both edges.
    """
    known = np.flatnonzero(np.sqrt(np.diagonal(refitted.covariance)) < _MODEL_ERROR * 10.0 * refitted.size)
    if not len(known):
        return None
    own = refitted.select(known)
    sides = [_edge(own, prior_model, neutral, sign) for sign in (1.0, -1.0)]
    found = [side for side in sides if side is not None]
    stopped = any(side.stopped for side in found)
    if not found or (len(found) < 2 and not stopped):
        return None
    width = float(np.mean([side.edge for side in found]))
    stderr = float(np.sqrt(np.sum([side.stderr**2 for side in found]))) / len(found)
    spread = 0.5 * float(np.ptp([side.edge for side in found]))
    gain = sum(side.gain for side in found)
    farthest = float(np.max(np.abs(own.commands - neutral)))
    if width < max(_SIGNIFICANCE * stderr, 0.02 * farthest) or gain < _MIN_GAIN:
        return None
    return DeadBand(width, math.hypot(stderr, spread), gain)


@dataclass(frozen=True)
class _Edge:
    edge: float
    stderr: float
    gain: float
    stopped: bool


def _edge(own: RefittedMap, prior_model: StaticMap, neutral: float, sign: float) -> _Edge | None:
    """Return the edge of the dead band on one side; None with too few levels or without evidence for an edge."""
    chosen = np.flatnonzero(sign * (own.commands - neutral) > 0.0)
    if len(chosen) < 2:
        return None
    side = own.select(chosen)
    distance = np.abs(side.commands - neutral)
    error = np.sqrt(np.diagonal(side.covariance)) + _MODEL_ERROR * own.size
    nominal = np.abs(np.asarray(prior_model(side.commands)))
    at_rest = (np.abs(side.values) < _SIGNIFICANCE * error) & (nominal > 2.0 * _SIGNIFICANCE * error)
    moving = ~at_rest
    if at_rest.any():
        nearest = float(distance[moving].min()) if moving.any() else math.inf
        farthest_still = float(distance[at_rest].max())
        if nearest < farthest_still or not math.isfinite(nearest):
            return None
        gain = float(np.sum((nominal[at_rest] / error[at_rest]) ** 2))
        edge, stderr = _between(side.select(np.flatnonzero(moving)), neutral, farthest_still, nearest)
        return _Edge(edge, stderr, gain, stopped=True)
    return _extrapolated(side, neutral)


def _between(side: RefittedMap, neutral: float, low: float, high: float) -> tuple[float, float]:
    """Return an edge between the last level at rest and the first in motion, with its standard error."""
    middle, spread = 0.5 * (low + high), (high - low) / math.sqrt(12.0)
    if len(side.values) < _MIN_INSIDE:
        return middle, spread
    found = _shifted(side.select(np.argsort(np.abs(side.commands - neutral))[:_MAX_LEVELS]), neutral, low, high)
    if found is None:
        return middle, spread
    return found[1], min(max(found[2], 0.01 * (high - low)), spread)


def _extrapolated(side: RefittedMap, neutral: float) -> _Edge | None:
    """Return an edge extrapolated from the levels in motion, if no curve from neutral fits as well."""
    side = side.select(np.argsort(np.abs(side.commands - neutral))[:_MAX_LEVELS])
    nearest = float(np.min(np.abs(side.commands - neutral)))
    found = _shifted(side, neutral, -0.5 * nearest, nearest)
    if found is None:
        return None
    chi, edge, stderr = found
    alternatives = [_misfit(side, basis, parameters) for basis, parameters in _curves(side, neutral, 0.0, most=3)]
    gain = min((alternative for alternative in alternatives if alternative is not None), default=chi) - chi
    return _Edge(edge, stderr, gain, stopped=False) if gain > 0.0 else _Edge(0.0, stderr, 0.0, stopped=False)


def _curves(side: RefittedMap, neutral: float, edge: float, *, most: int) -> Iterator[tuple[Floats, int]]:
    """Yield curves that begin at an edge, as bases (n, p) with their number of parameters.

    They are polynomials, saturating curves, and curves that rise slowly at first.
    """
    distance = np.maximum(np.abs(side.commands - neutral) - edge, 0.0)
    for count in range(1, most + 1):
        yield distance[:, None] ** np.arange(1, count + 1), count
    for saturation in _SATURATIONS * float(distance.max()):
        yield (distance / (distance + saturation))[:, None], 2
        yield (-np.expm1(-distance / saturation))[:, None], 2


def _misfit(side: RefittedMap, basis: Floats, parameters: int) -> float | None:
    """Return χ² with a penalty per parameter; None if the curve has as many parameters as values."""
    return None if parameters >= len(side.values) else side.fit(basis)[0] + _PER_PARAMETER * parameters


def _shifted(side: RefittedMap, neutral: float, low: float, high: float) -> tuple[float, float, float] | None:
    """Fit curves that begin at an edge between `low` and `high`; return χ², the edge and its standard error."""
    edges = np.linspace(low, high, _WIDTHS + 2)[1:-1]
    tried = [
        [_misfit(side, basis, parameters + 1) for basis, parameters in _curves(side, neutral, e, most=2)]
        for e in edges.tolist()
    ]
    misfits = np.array([min((m for m in row if m is not None), default=np.inf) for row in tried])
    if not np.isfinite(misfits).any():
        return None
    best, step = int(np.argmin(misfits)), float(edges[1] - edges[0])
    least = float(misfits[best])
    # χ² rises by one within a standard error.
    within = edges[misfits <= least + 1.0]
    stderr = max(0.5 * float(np.ptp(within)), step)
    if best in (0, len(edges) - 1):
        return least, float(edges[best]), stderr
    slopes = misfits[best - 1] - least, misfits[best + 1] - least
    shift = 0.5 * step * float((slopes[0] - slopes[1]) / max(slopes[0] + slopes[1], 1e-12))
    return least, float(edges[best] + shift), stderr
