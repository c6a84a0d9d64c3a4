"""A line between end stops, with the stops found in the data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.maps.map_fit import ExcludedPoint, MapFit, assess_map, require_points, rounded, without
from agvbench.calibration.maps.polynomial import polynomial
from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError
from agvbench.signals import robust_std
from agvbench.types import Floats
from agvbench.vehicle.maps import LineWithEndStops

# A point is off the map, and left out, beyond this many standard deviations and this share of the range of outputs.
_OUTLIER_SIGMAS = 6.0
_OUTLIER_SHARE = 0.05
_MOST_OUTLIERS = 0.2
_MIN_ON_LINE = 3


def fit_line_with_end_stops(points: CurvePoints) -> MapFit:
    """Fit a line that is held between two stops, and say at which commands it is held.

    Each way of calling some outermost points saturated is tried: least squares through the rest, the mean of the
    saturated as the stop. It is admitted if the line really passes beyond the stop at every saturated command, and
    not before. Among the admitted the Bayesian information criterion decides, so that each stop pays for its
    parameter. A stop that was never reached is put where the line is at the outermost command: what lies beyond was
    not measured. A point that no such map comes near (a spoilt run) is left out, and reported.

    Raises
    ------
    FitError
        If there are fewer than four commands, or the output does not change with them.
    """
    require_points(points, 4, "line with end stops")
    reasons: dict[float, str] = {}
    while True:
        kept = points.select(without(points, reasons))
        best = _best_split(kept)
        residual = kept.value - best.predict(kept.command)
        limit = max(_OUTLIER_SIGMAS * robust_std(residual), _OUTLIER_SHARE * float(np.ptp(kept.value)))
        worst = int(np.argmax(np.abs(residual)))
        if abs(residual[worst]) <= limit or len(reasons) + 1 > _MOST_OUTLIERS * len(points):
            break
        reasons[float(kept.command[worst])] = "off the map by more than the dispersion of the others explains"
    static_map = LineWithEndStops(rounded(best.slope), rounded(best.intercept), rounded(best.low), rounded(best.high))
    return assess_map(
        "line_with_end_stops",
        static_map,
        points,
        parameters=best.parameters,
        stderr=_stderr(kept, best),
        reasons=reasons,
    )


@dataclass(frozen=True)
class _Split:
    first: int
    last: int
    slope: float
    intercept: float
    low: float
    high: float
    parameters: int
    score: float
    sd: float

    def predict(self, command: Floats) -> Floats:
        return np.clip(self.slope * command + self.intercept, self.low, self.high)


def _best_split(points: CurvePoints) -> _Split:
    n = len(points)
    splits = [
        split
        for first in range(n - _MIN_ON_LINE + 1)
        for last in range(first + _MIN_ON_LINE, n + 1)
        if (split := _split(points, first, last)) is not None
    ]
    if not splits:
        raise FitError(
            "the output does not change with the command",
            value=f"{points.value.min():.4g} … {points.value.max():.4g} over {n} commands",
            remedy="vary the command over its whole range",
        )
    return min(splits, key=lambda split: split.score)


def _split(points: CurvePoints, first: int, last: int) -> _Split | None:
    """Return the map with points before `first` and from `last` on saturated, or None if it contradicts itself."""
    command, value = points.command, points.value
    x, y = command[first:last] - command[first:last].mean(), value[first:last]
    slope = float(x @ y) / float(x @ x)
    if slope == 0.0:
        return None
    intercept = float(y.mean()) - slope * float(command[first:last].mean())
    line = slope * command + intercept
    residual = y - line[first:last]
    sd = math.sqrt(float(residual @ residual) / max(len(y) - 2, 1))
    before = float(np.mean(value[:first])) if first else float(line[0])
    after = float(np.mean(value[last:])) if last < len(points) else float(line[-1])
    rising = 1.0 if slope > 0.0 else -1.0
    slack = 2.0 * sd
    # The saturated must be held back from where the line would go, and the others must not be beyond the stops.
    if np.any(rising * (line[:first] - before) > 0.0) or np.any(rising * (line[last:] - after) < 0.0):
        return None
    inside = line[first:last]
    if np.any(rising * (inside - before) < -slack) or np.any(rising * (inside - after) > slack):
        return None
    if not rising * (after - before) > 0.0:
        return None
    low, high = (before, after) if rising > 0.0 else (after, before)
    error = value - np.clip(line, low, high)
    stops = (first > 0) + (last < len(points))
    variance = max(float(error @ error) / len(points), (1e-9 * float(np.ptp(value))) ** 2)
    score = len(points) * math.log(variance) + (2 + stops) * math.log(len(points))
    return _Split(first, last, slope, intercept, low, high, 2 + stops, score, sd)


def _stderr(points: CurvePoints, split: _Split) -> dict[str, float]:
    _, (slope_se, intercept_se) = polynomial(points.select(_between(points, split)), 1)
    stderr = {"slope": slope_se, "intercept": intercept_se}
    names = ("output_low", "output_high") if split.slope > 0.0 else ("output_high", "output_low")
    for name, group in zip(names, (points.value[: split.first], points.value[split.last :]), strict=True):
        if len(group):
            stderr[name] = max(split.sd, float(np.std(group))) / math.sqrt(len(group))
    return stderr


def _between(points: CurvePoints, split: _Split) -> NDArray[np.bool_]:
    index = np.arange(len(points))
    return (index >= split.first) & (index < split.last)


def saturated(fit: MapFit) -> tuple[ExcludedPoint, ...]:
    """Return the points that a fit holds for saturated: at a stop, and so not on the line."""
    low, high = fit.map.command_range
    return tuple(
        ExcludedPoint(float(c), float(v), "at the end stop")
        for c, v in zip(fit.points.command, fit.points.value, strict=True)
        if c < low or c > high
    )
