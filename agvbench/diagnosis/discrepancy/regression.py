"""Regression of residual rates on shapes, with the part removed that the nodal maps can absorb.

The weights follow from the residuals themselves: with the cameras' noise as weight, everything would be significant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms.steering import lags_after
from agvbench.types import Floats

FOLDS = 5
REACHES_RAD = (0.05, 0.1, 0.2, 0.4)
RECOVERIES_S = (0.2, 0.4, 0.8, 1.6)

_MIN_SCALE = 1e-9
_WINSOR_LIMIT, _WINSOR_QUANTILE = 3.0, 0.99

Columns = dict[int, Floats]
"""Regressors (n, q) by feature: 0 longitudinal, 1 lateral, 2 turning."""


@dataclass(frozen=True)
class SteeringTangents:
    """Tangents of the steady-state angles of both axles (n, 2) at each residual rate.

    They mean nothing for a differential vehicle. ``previous`` (n, 2): those under the previous
    steering command; ``reversal`` (n, 2): those at which each axle last reversed; ``levels`` (n, 3): index of the level
    of drive, front and rear in force; ``lags`` (n, 2, reaches): how far an axle lags behind by a hysteresis of each of
    `REACHES_RAD`; ``loads`` (n, times): what the servos have moved recently, by each of `RECOVERIES_S` [rad];
    ``creeps`` (n, 2, times): the same of each axle, with its sign.
    """

    tangent: Floats
    previous: Floats
    reversal: Floats
    levels: NDArray[np.int64]
    lags: Floats
    loads: Floats
    creeps: Floats


def steering_tangents(batch: Batch, parameters: Floats, rates: Rates) -> SteeringTangents:
    """Return the steering_tangents tangents at each rate, by the nodal values in `parameters`."""
    where = batch.maps.slices()
    settled = np.column_stack([batch.weights[role] @ parameters[where[role]] for role in ("front", "rear")])
    tangent = np.tan(np.clip(settled, -1.4, 1.4))
    previous, reversal, lags = tangent.copy(), tangent.copy(), np.zeros((*tangent.shape, len(REACHES_RAD)))
    for k, role in enumerate(("front", "rear")):
        command = batch.commands[role]
        for row in range(1, len(command)):
            if batch.base.row_runs[row] == batch.base.row_runs[row - 1]:
                same = command[row] == command[row - 1]
                previous[row, k] = previous[row - 1, k] if same else tangent[row - 1, k]
                last = reversal[row - 1, k]
                reverses = (tangent[row, k] - tangent[row - 1, k]) * (tangent[row - 1, k] - last) < 0.0
                reversal[row, k] = tangent[row - 1, k] if reverses else last
                travel = float(settled[row, k] - settled[row - 1, k])
                lags[row, k] = [
                    lags_after(before, travel, reach) if travel else before
                    for before, reach in zip(lags[row - 1, k], REACHES_RAD, strict=True)
                ]
    moves = _moves(batch, settled)
    rows, moved = np.empty(len(rates.run), dtype=np.int64), np.empty((len(rates.run), *moves.shape[1:]))
    for r in np.unique(rates.run):
        own = rates.run == r
        times, now = batch.readings.runs[r].commands.t_s, rates.covariates["time_in_run_s"][own]
        at = np.searchsorted(times, now, side="right")
        rows[own] = batch.base.row_starts[r] + at
        since = now - np.r_[times[:1], times][at]
        moved[own] = moves[rows[own]] * np.exp(-np.maximum(since, 0.0)[:, None, None] / RECOVERIES_S)
    levels = np.column_stack(
        [np.unique(batch.commands[role], return_inverse=True)[1][rows] for role in ("drive", "front", "rear")]
    )
    angles = tangent[rows], previous[rows], reversal[rows]
    return SteeringTangents(*angles, levels, lags[rows], moved[:, 0], moved[:, 1:])


def _moves(batch: Batch, settled: Floats) -> Floats:
    """Return what the servos have moved recently (rows, 3, times) right after each command.

    That is the sum of both amounts, and the way of either axle with its sign, for steady-state angles (rows, 2).
    """
    moves = np.zeros((len(settled), 3, len(RECOVERIES_S)))
    for r, run in enumerate(batch.readings.runs):
        first, last = batch.base.row_starts[r : r + 2]
        times = run.commands.t_s
        left = np.exp(-np.diff(times, prepend=times[0])[:, None] / RECOVERIES_S)
        ways = np.diff(settled[first:last], axis=0)
        ways = np.column_stack([np.abs(ways).sum(axis=1), ways])[:, :, None]
        for row in range(first + 1, last):
            moves[row] = moves[row - 1] * left[row - first - 1] + ways[row - first - 1]
    return moves


class GroupedRegression:
    """Regression of residual rates without the part that maps absorb, each feature in units of its residual."""

    def __init__(self, rates: Rates, tangents: SteeringTangents, fold: NDArray[np.int64]) -> None:
        self.folds, self.sqrt_weight = [np.flatnonzero(fold == f) for f in range(FOLDS)], np.sqrt(rates.weight)
        drive, axles = _dummies(tangents.levels[:, 0]), [_dummies(tangents.levels[:, k]) for k in (1, 2)]
        self.absorbed = [self._orthogonal([drive]), *[self._orthogonal(axles)] * 2]
        self.values = [self._without_maps(k, winsorised(rates.value[:, k])) for k in range(3)]
        self.size = [max(float(np.sqrt(np.mean(v * v))), _MIN_SCALE) for v in self.values]
        self.values = [v / s for v, s in zip(self.values, self.size, strict=True)]
        self.count = len(np.unique(rates.run))

    def _orthogonal(self, blocks: Sequence[Floats]) -> Floats:
        matrix = np.column_stack([np.ones(len(self.sqrt_weight)), *blocks]) * self.sqrt_weight[:, None]
        left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
        return np.asarray(left[:, singular > 1e-8 * singular[0]])

    def _without_maps(self, k: int, columns: Floats) -> Floats:
        weighted = (columns.T * self.sqrt_weight).T
        return np.asarray(weighted - self.absorbed[k] @ (self.absorbed[k].T @ weighted))

    def gain(self, columns: Columns) -> tuple[float, Floats]:
        """Return the log likelihood gain of `columns` in the folds left out, and their coefficients from all folds."""
        projected = {k: self._without_maps(k, c) / self.size[k] for k, c in columns.items()}
        matrices, gradients = (
            np.array(of) for of in zip(*(self._products(k, c) for k, c in projected.items()), strict=True)
        )
        matrices_of_folds, gradients_of_folds = matrices.sum(axis=0), gradients.sum(axis=0)
        matrix, gradient = matrices_of_folds.sum(axis=0), gradients_of_folds.sum(axis=0)
        ridge = (1e-9 * np.trace(matrix) + 1e-300) * np.eye(len(gradient))
        # Coefficients from all folds, then from all but each fold.
        remaining, remaining_gradients = (
            np.concatenate([matrix[None], matrix - matrices_of_folds]),
            np.vstack([gradient, gradient - gradients_of_folds]),
        )
        coefficients = np.linalg.solve(remaining + ridge, remaining_gradients[..., None])[..., 0]
        others = coefficients[1:]
        change = np.einsum("fi,kfij,fj->k", others, matrices, others) - 2.0 * np.einsum("kfi,fi->k", gradients, others)
        gain = -np.log(np.maximum(1.0 + change / len(self.sqrt_weight), _MIN_SCALE)).sum()
        return float(0.5 * self.count * gain), coefficients[0]

    def _products(self, k: int, columns: Floats) -> tuple[Floats, Floats]:
        """Return the products of columns (n, q) with each other (folds, q, q) and with feature `k` (folds, q)."""
        parts = [(columns[own], self.values[k][own]) for own in self.folds]
        return np.array([c.T @ c for c, _ in parts]), np.array([c.T @ v for c, v in parts])


def winsorised(value: Floats) -> Floats:
    """Winsorise the values (n,): a single run with large residuals must not dominate the regression."""
    limit = _WINSOR_LIMIT * float(np.quantile(np.abs(value - np.median(value)), _WINSOR_QUANTILE))
    return np.clip(value, np.median(value) - limit, np.median(value) + limit)


def _dummies(level: NDArray[np.int64]) -> Floats:
    return np.asarray((level[:, None] == np.unique(level)[None, :]).astype(np.float64))
