"""Shapes of speed, lateral velocity and turning of the whole vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.command_history import LOADS_S, RECOVERIES_S, CommandHistory
from agvbench.diagnosis.discrepancy.regression import Columns
from agvbench.diagnosis.discrepancy.shapes.base import RUN_TIMES_S, Evidence, Option, Shapes, Values
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms.speed import angle_beyond
from agvbench.types import Floats

_FROM_RAD, _ANGLE_REACHES_RAD = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5), (0.03, 0.2, 1.0)
_COASTS_S = 0.2
_PAUSES_S, _LEAST_LOST = (0.1, 0.2, 0.4), 0.05
_WAVES_M = np.geomspace(0.12, 1.5, 50)


class _Pause(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        return [max(float(coefficients[0]), 0.0) * self.fixed[0]]


class _Wave(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        return [*self.fixed, *coefficients.tolist()]


def motion_shapes(of: Evidence) -> Shapes:
    """Yield the terms by heading, by time in the run, by what was driven and steered, and by distance."""
    rates, history, c = of.rates, of.history, of.rates.covariates
    sine = np.column_stack([np.cos(c["heading_rad"]), np.sin(c["heading_rad"])])
    course = np.column_stack([np.cos(c["course_rad"]), np.sin(c["course_rad"])])
    yield terms.SpeedByHeading, iter([({0: sine}, Values())])
    yield terms.SpeedByCourse, iter([({0: course}, Values())])
    yield terms.TurnByHeading, iter([({2: sine}, Values())])
    yield terms.SlipByYawRate, iter([(_slips(rates), Values())])
    yield terms.SpeedByRunTime, _run_times(rates)
    yield terms.SpeedAfterDriving, _drive_loads(history)
    yield terms.PauseAtReversal, _pauses(history)
    yield terms.TwistAtStart, _starts(rates)
    yield terms.TurnWhileCoasting, iter([(_stops(rates), Values())])
    yield terms.WaveByDistance, _waves(rates)
    if of.geometry.is_differential:
        direction = c["direction"][:, None]
        yield terms.TurnByDirection, iter([({1: of.geometry.rear_axle_m * direction, 2: direction}, Values())])
    else:
        yield terms.SpeedBySteering, _rubbing(np.arctan(history.tangent))
        yield terms.SpeedAfterSteering, _loads(history)


def _run_times(rates: Rates) -> Iterator[Option]:
    for constant in RUN_TIMES_S:
        column = np.expm1(-rates.covariates["time_in_run_s"] / constant)
        yield {0: column[:, None]}, Values(constant)


def _drive_loads(history: CommandHistory) -> Iterator[Option]:
    for number, constant in enumerate(LOADS_S):
        yield {0: -history.drive_load[:, [number]]}, Values(constant)


def _pauses(history: CommandHistory) -> Iterator[Option]:
    """Yield losses of speed after a reversal; the pause is the product of their size and their duration."""
    for constant in _PAUSES_S:
        lost = np.exp(-history.reversed_s / constant)
        if np.any(lost > _LEAST_LOST):
            yield {0: -lost[:, None]}, _Pause(constant)


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
