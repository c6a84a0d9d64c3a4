"""Screening of discrepancy terms, by linear regression of residual rates on a grid of shapes.

Nonlinear parameters of a shape (a position, a radius, a time constant) come from the grid, linear ones from least
squares. Groups of runs that are left out decide on the rank of a shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis import terms
from agvbench.diagnosis.criteria import DISCREPANCY
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.discrepancy.campaign_time import (
    by_axle_angles,
    by_both_axles,
    by_steering_gain,
    changes,
    columns_by_campaign_time,
)
from agvbench.diagnosis.discrepancy.command_history import (
    DEAD_BANDS,
    LOADS_S,
    REACHES_RAD,
    RECOVERIES_S,
    SLIPS_BEYOND,
    CommandHistory,
)
from agvbench.diagnosis.discrepancy.regression import FOLDS, Columns, GroupedRegression
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.diagnosis.terms.speed import angle_beyond
from agvbench.diagnosis.terms.steering import TYPICAL_MPS
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_SHARES_OF_STEP = (0.1, 0.3, 0.5, 0.7, 0.9)
_RADII_M = (0.2, 0.35, 0.5, 0.8)
_DISC_STEP, _LINE_STEP = 18, 40
_LINE_DIRECTIONS = 16
_STRIP_DIRECTIONS, _STRIP_STEP, _WIDTHS_M = 8, 16, (0.3, 0.6, 1.0, 1.6)
_BLUR_M, _SHARP_M, _BEST_LINES, _FINE_STEPS, _MIN_CROSSINGS = 0.1, 0.01, 4, 9, 5
_POINT_STEP, _CORES_M = 12, (0.1, 0.5, 2.0)
_RUN_TIMES_S = (0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
_FROM_RAD, _ANGLE_REACHES_RAD = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5), (0.03, 0.2, 1.0)
_COASTS_S = 0.2
_CABLE_STEPS, _SLACKS_M = 9, (0.0, 0.3, 0.7, 1.2)
_FORCES = (0.01, 0.03, 0.1, 0.3, 1.0)
_PAUSES_S, _LEAST_LOST = (0.1, 0.2, 0.4), 0.05
_WAVES_M = np.geomspace(0.12, 1.5, 50)

Option = tuple[Columns, Callable[[Floats], list[float]]]


class Values:
    """Composes a term's parameters from regression coefficients and grid values, in the term's order."""

    def __init__(self, *fixed: float) -> None:
        self.fixed = fixed

    def __call__(self, coefficients: Floats) -> list[float]:
        """Return the parameters: coefficients, then grid values."""
        return [*coefficients.tolist(), *self.fixed]


class _Picture(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        bend = float(coefficients[0])
        limit = 3.0
        centre = [float(np.clip(s / bend, -limit, limit)) if bend else 0.0 for s in coefficients[1:]]
        return [bend, *centre, 0.0, 0.0][:3]


class _Travel(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        half_width, (reach,) = max(float(coefficients[0]), 0.0), self.fixed
        return [half_width, 2.0 * half_width / reach]


class _Pause(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        return [max(float(coefficients[0]), 0.0) * self.fixed[0]]


class _Wave(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        return [*self.fixed, *coefficients.tolist()]


def options(
    rates: Rates, history: CommandHistory, geometry: Geometry, regression: GroupedRegression
) -> Iterator[tuple[type[terms.DiscrepancyTerm], Iterator[Option]]]:
    """Yield each term with its shapes: regressors, and the function that composes parameters."""
    c = rates.covariates
    sine = np.column_stack([np.cos(c["heading_rad"]), np.sin(c["heading_rad"])])
    yield terms.SpeedInDisc, _discs(rates)
    yield terms.SpeedInStrip, _strips(rates)
    yield terms.TurnAtLine, _lines(rates, regression)
    yield terms.BentPicture, _pictures(rates)
    yield terms.SkewedPicture, iter([(_skews(rates), Values())])
    yield terms.SpeedByHeading, iter([({0: sine}, Values())])
    course = np.column_stack([np.cos(c["course_rad"]), np.sin(c["course_rad"])])
    yield terms.SpeedByCourse, iter([({0: course}, Values())])
    yield terms.TurnByHeading, iter([({2: sine}, Values())])
    yield terms.SlipByYawRate, iter([(_slips(rates), Values())])
    yield terms.DriftToPoint, _points(rates)
    yield terms.DriftByPlace, iter([(_drifts(rates, _quadratic(rates.middle)), Values())])
    yield terms.PullOfCable, _cables(rates)
    yield terms.SpeedByRunTime, _run_times(rates)
    yield terms.SpeedAfterDriving, _drive_loads(history)
    yield terms.PauseAtReversal, _pauses(history)
    yield terms.SteeringAtStart, _starts_of_steering(rates, history, geometry)
    yield terms.TwistAtStart, _starts(rates)
    yield terms.TurnWhileCoasting, iter([(_stops(rates), Values())])
    for term, columns, change in changes(rates, history, geometry, regression):
        yield term, iter([(columns, change.values)])
    yield from _logged(rates, history, geometry)
    if geometry.is_differential:
        direction = c["direction"][:, None]
        columns = {1: geometry.rear_axle_m * direction, 2: direction}
        yield terms.TurnByDirection, iter([(columns, Values())])
    else:
        yield from _steering(rates, history, geometry, regression)
    yield terms.WaveByDistance, _waves(rates)


def _steering(
    rates: Rates, history: CommandHistory, geometry: Geometry, regression: GroupedRegression
) -> Iterator[tuple[type[DiscrepancyTerm], Iterator[Option]]]:
    """Yield the terms of steered axles: by direction of travel, and by what was steered before."""
    direction = rates.covariates["direction"]
    yield terms.SteeringByDirection, iter([(by_axle_angles(direction, direction, history, geometry), Values())])
    velocity = direction * rates.covariates["speed_mps"]
    yield terms.SteeringByVelocity, iter([(by_axle_angles(velocity, velocity, history, geometry), Values())])
    angles = np.arctan(history.tangent)
    faster = (rates.covariates["speed_mps"] - TYPICAL_MPS)[:, None] * angles
    yield terms.SteeringBySpeed, iter([(by_axle_angles(faster[:, 0], faster[:, 1], history, geometry), Values())])
    turns = velocity * (history.tangent[:, 0] - history.tangent[:, 1])
    yield terms.SteeringByYawRate, iter([(by_axle_angles(-turns, -turns, history, geometry), Values())])
    yield terms.SteeringBySideForce, _side_forces(velocity * turns, history, geometry)
    turned = _turned(rates)
    yield terms.SteeringByTurnedHeading, iter([(by_axle_angles(turned, turned, history, geometry), Values())])
    yield terms.SpeedBySteering, _rubbing(angles)
    yield terms.SpeedAfterSteering, _loads(history)
    changes_back = [np.arctan(before) - angles for before in (history.previous, history.reversal)]
    if np.any(changes_back[0] != 0.0):
        both = [by_both_axles(angle, history, geometry) for angle in changes_back]
        columns = {k: np.hstack([shares[k] for shares in both]) for k in both[0]}
        yield terms.SteeringByHistory, iter([(columns, Values())])
        yield terms.SteeringByTravel, _travels(history, geometry)
        yield terms.SteeringCreep, _creeps(history, geometry)
        yield terms.SteeringDeadBand, _dead_bands(history, geometry)
        yield terms.SteeringSlip, _slips_of_linkage(history, geometry, regression)


def _rubbing(angles: Floats) -> Iterator[Option]:
    """Yield losses of speed by angles (n, 2) beyond each of a few: of the front and the rear axle, left and right."""
    sides = np.column_stack([angles[:, 0], -angles[:, 0], angles[:, 1], -angles[:, 1]])
    for begin in _FROM_RAD:
        for reach in _ANGLE_REACHES_RAD:
            losses = -np.vectorize(angle_beyond)(sides, begin, reach)
            if np.all(np.any(losses < 0.0, axis=0)):
                yield {0: losses}, Values(begin, reach)


def _loads(history: CommandHistory) -> Iterator[Option]:
    for number, constant in enumerate(RECOVERIES_S):
        if np.any(history.loads[:, number] > 0.0):
            yield {0: -history.loads[:, [number]]}, Values(constant)


def _creeps(history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for number, constant in enumerate(RECOVERIES_S):
        yield by_both_axles(history.creeps[:, :, number], history, geometry), Values(constant)


def _dead_bands(history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for number, band in enumerate(DEAD_BANDS):
        yield by_both_axles(history.kept[:, :, number], history, geometry), Values(band * history.reach)


def _slips_of_linkage(history: CommandHistory, geometry: Geometry, regression: GroupedRegression) -> Iterator[Option]:
    """Yield slips beyond the same distance to either side of neutral, then beyond another one on one side."""

    def option(above: int, below: int) -> Option:
        side = np.sign(history.above[:, :, above] - history.below[:, :, below])
        values = Values(SLIPS_BEYOND[above] * history.reach, SLIPS_BEYOND[below] * history.reach)
        return by_both_axles(-side, history, geometry), values

    every = range(len(SLIPS_BEYOND))
    gains = [regression.gain(option(k, k)[0])[0] for k in every]
    best = int(np.argmax(gains))
    for k in every:
        yield option(k, best)
        yield option(best, k)


def _side_forces(force: Floats, history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for reach in _FORCES:
        share = np.tanh(force / reach)
        yield by_axle_angles(share, share, history, geometry), Values(reach)


def _turned(rates: Rates) -> Floats:
    """Return the heading turned since the start of the run, at each rate (n,)."""
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    first = np.flatnonzero(np.r_[True, np.diff(rates.run) != 0])
    return np.asarray(heading - np.repeat(rates.begin[first, 2], np.diff(np.r_[first, len(heading)])))


def _drive_loads(history: CommandHistory) -> Iterator[Option]:
    for number, constant in enumerate(LOADS_S):
        yield {0: -history.drive_load[:, [number]]}, Values(constant)


def _pauses(history: CommandHistory) -> Iterator[Option]:
    """Yield losses of speed after a reversal; the pause is the product of their size and their duration."""
    for constant in _PAUSES_S:
        lost = np.exp(-history.reversed_s / constant)
        if np.any(lost > _LEAST_LOST):
            yield {0: -lost[:, None]}, _Pause(constant)


def _travels(history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for number, reach in enumerate(REACHES_RAD):
        yield by_both_axles(-history.lags[:, :, number], history, geometry), _Travel(reach)


_BY_LOGGED_COLUMN: dict[type[DiscrepancyTerm], type[terms.ByLoggedColumn]] = {
    terms.SpeedByCampaignTime: terms.SpeedByLoggedColumn,
    terms.SteeringByCampaignTime: terms.SteeringByLoggedColumn,
    terms.TrimByCampaignTime: terms.TrimByLoggedColumn,
}


def _logged(
    rates: Rates, history: CommandHistory, geometry: Geometry
) -> Iterator[tuple[type[terms.DiscrepancyTerm], Iterator[Option]]]:
    """Yield the terms of logged columns: the regressors of a change with time, in proportion to each column."""
    if not rates.standardised.shape[1]:
        return
    for of_time, columns in columns_by_campaign_time(rates, history, geometry):
        if of_time in _BY_LOGGED_COLUMN:
            yield _BY_LOGGED_COLUMN[of_time], _in_proportion(columns, rates.standardised)


def _in_proportion(columns: Columns, standardised: Floats) -> Iterator[Option]:
    for number, z in enumerate(standardised.T):
        yield {k: z[:, None] * column for k, column in columns.items()}, Values(float(number))


def _run_times(rates: Rates) -> Iterator[Option]:
    for constant in _RUN_TIMES_S:
        column = np.expm1(-rates.covariates["time_in_run_s"] / constant)
        yield {0: column[:, None]}, Values(constant)


def _starts_of_steering(rates: Rates, history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    gain = by_steering_gain(rates, history, geometry)
    for constant in _RUN_TIMES_S:
        loss = rates.covariates["speed_mps"] * np.exp(-rates.covariates["time_in_run_s"] / constant)
        yield {k: -loss[:, None] * column for k, column in gain.items()}, Values(constant)


def _starts(rates: Rates) -> Iterator[Option]:
    first = np.r_[True, np.diff(rates.run) != 0] / rates.weight
    zero = np.zeros_like(first)
    lag = -first * rates.covariates["speed_mps"]
    turns = [first, first * rates.covariates["direction"]]
    yield {0: np.column_stack([zero, zero, lag]), 2: np.column_stack([*turns, zero])}, Values()


def _stops(rates: Rates) -> Columns:
    """Return the regressor of a curvature while each run ends, on a way in proportion to the speed before."""
    last = np.r_[np.diff(rates.run) != 0, True] / rates.weight
    return {2: (_COASTS_S * last * rates.covariates["speed_mps"])[:, None]}


def _slips(rates: Rates) -> Columns:
    """Return the regressors of a lateral velocity and of a loss of yaw rate, both in proportion to the yaw rate."""
    curvature, zero = rates.covariates["curvature_per_m"], np.zeros(len(rates.run))
    yaw_rate = curvature * rates.covariates["speed_mps"]
    side = rates.covariates["direction"] * yaw_rate
    return {1: np.column_stack([side, zero]), 2: np.column_stack([zero, -np.abs(yaw_rate) * curvature])}


def _waves(rates: Rates) -> Iterator[Option]:
    zero = np.zeros((len(rates.run), 2))
    for period in _WAVES_M:
        angle = math.tau * rates.covariates["distance_m"] / period
        wave = np.column_stack([np.cos(angle), np.sin(angle)])
        columns = {0: [wave, zero, zero], 2: [zero, wave, zero], 1: [zero, zero, wave]}
        yield {feature: np.hstack(parts) for feature, parts in columns.items()}, _Wave(float(period))


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


def _skews(rates: Rates) -> Columns:
    """Return the regressors of a skew and of a stretch of the position."""
    moved = rates.end - rates.begin
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    displaced = np.column_stack([moved[:, 1], moved[:, 0]]) * (rates.covariates["direction"] / rates.weight)[:, None]
    return {0: displaced * np.cos(heading)[:, None], 1: -displaced * np.sin(heading)[:, None]}


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


def _pictures(rates: Rates) -> Iterator[Option]:
    def field(p: Floats) -> Floats:
        """Return displacements (3, n, 2): for the bend about the origin, and for both coordinates of its centre."""
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
    longitudinal = (moved[..., 0] * c + moved[..., 1] * s) * per
    lateral = (moved[..., 1] * c - moved[..., 0] * s) * per
    yield {0: longitudinal[:1].T, 1: lateral[:1].T}, _Picture()
    yield {0: longitudinal.T, 1: lateral.T}, _Picture()


_REDUCED_SIZE = 0.1


@dataclass(frozen=True)
class Start:
    """A term with initial values (n, p) of a fit, and its ``gain``: the log likelihood ratio in runs left out.

    Every second row is the same shape at a tenth of its size. It is for cases in which the random effects of runs have
    absorbed the cause and release it in small steps only.
    """

    term: type[DiscrepancyTerm]
    values: Floats
    gain: float

    def beside(self, other: Start) -> Start:
        """Return the start with those initial values that gain at least about as much, this or another shape's."""
        best, worse = sorted((self, other), key=lambda start: -start.gain)
        near = worse.gain > DISCREPANCY.min_share_of_best_start * best.gain
        return replace(best, values=np.vstack([best.values, worse.values])) if near else best


def screen(
    rates: Rates, history: CommandHistory, geometry: Geometry, group: NDArray[np.int64], seed: int
) -> list[Start]:
    """Return the best start of each term with a predicted gain, the largest gain first."""
    regression = GroupedRegression(rates, history, folds(group, FOLDS, seed)[rates.run])
    found: dict[type[DiscrepancyTerm], Start] = {}
    for term, shapes in options(rates, history, geometry, regression):
        best: Start | None = None
        for columns, values in shapes:
            gain, coefficients = regression.gain(columns)
            if gain > (best.gain if best else 0.0):
                best = Start(
                    term, np.array([values(coefficients), values(_REDUCED_SIZE * coefficients)], dtype=np.float64), gain
                )
        if best is not None:
            found[term] = best if term not in found else found[term].beside(best)
    return sorted(found.values(), key=lambda start: -start.gain)
