"""Shapes of the axle angles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.campaign_time import by_axle_angles, by_both_axles, by_steering_gain
from agvbench.diagnosis.discrepancy.command_history import (
    DEAD_BANDS,
    REACHES_RAD,
    RECOVERIES_S,
    SLIPS_BEYOND,
    CommandHistory,
)
from agvbench.diagnosis.discrepancy.regression import GroupedRegression
from agvbench.diagnosis.discrepancy.shapes.base import RUN_TIMES_S, Evidence, Option, Shapes, Values
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms.steering import TYPICAL_MPS
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_FORCES = (0.01, 0.03, 0.1, 0.3, 1.0)


class _Travel(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        half_width, (reach,) = max(float(coefficients[0]), 0.0), self.fixed
        return [half_width, 2.0 * half_width / reach]


def steering_shapes(of: Evidence) -> Shapes:
    """Yield the terms of the axle angles; those of a differential vehicle are the terms of its yaw rate only."""
    rates, history, geometry = of.rates, of.history, of.geometry
    yield terms.SteeringAtStart, _starts_of_steering(rates, history, geometry)
    if geometry.is_differential:
        return
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
    if np.any(history.previous != history.tangent):
        yield from _after_other_commands(of)


def _after_other_commands(of: Evidence) -> Shapes:
    """Yield the terms that depend on what was steered before."""
    history, geometry, angles = of.history, of.geometry, np.arctan(of.history.tangent)
    changes_back = [np.arctan(before) - angles for before in (history.previous, history.reversal)]
    both = [by_both_axles(angle, history, geometry) for angle in changes_back]
    columns = {k: np.hstack([shares[k] for shares in both]) for k in both[0]}
    yield terms.SteeringByHistory, iter([(columns, Values())])
    yield terms.SteeringByTravel, _travels(history, geometry)
    yield terms.SteeringCreep, _creeps(history, geometry)
    yield terms.SteeringDeadBand, _dead_bands(history, geometry)
    yield terms.SteeringSlip, _slips_of_linkage(history, geometry, of.regression)


def _starts_of_steering(rates: Rates, history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    gain = by_steering_gain(rates, history, geometry)
    for constant in RUN_TIMES_S:
        loss = rates.covariates["speed_mps"] * np.exp(-rates.covariates["time_in_run_s"] / constant)
        yield {k: -loss[:, None] * column for k, column in gain.items()}, Values(constant)


def _side_forces(force: Floats, history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for reach in _FORCES:
        share = np.tanh(force / reach)
        yield by_axle_angles(share, share, history, geometry), Values(reach)


def _turned(rates: Rates) -> Floats:
    """Return the heading turned since the start of the run, at each rate (n,)."""
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    first = np.flatnonzero(np.r_[True, np.diff(rates.run) != 0])
    return np.asarray(heading - np.repeat(rates.begin[first, 2], np.diff(np.r_[first, len(heading)])))


def _travels(history: CommandHistory, geometry: Geometry) -> Iterator[Option]:
    for number, reach in enumerate(REACHES_RAD):
        yield by_both_axles(-history.lags[:, :, number], history, geometry), _Travel(reach)


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
