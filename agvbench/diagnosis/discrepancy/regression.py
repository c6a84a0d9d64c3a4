"""Regression of residual rates on shapes, with the part removed that the nodal maps can absorb.

The weights follow from the residuals themselves: with the cameras' noise as weight, everything would be significant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.discrepancy.command_history import CommandHistory
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.types import Floats

FOLDS = 5

_MIN_SCALE = 1e-9
_WINSOR_LIMIT, _WINSOR_QUANTILE = 3.0, 0.99

Columns = dict[int, Floats]
"""Regressors (n, q) by feature: 0 longitudinal, 1 lateral, 2 turning."""


class GroupedRegression:
    """Regression of residual rates without the part that maps absorb, each feature in units of its residual.

    The map of a steered axle absorbs what depends on its command. Where the rear axle is never steered, the lateral
    velocity is that at the rear axle, ``rear_axle_m`` behind the marker centroid: no map of the front axle changes it.
    """

    def __init__(
        self, rates: Rates, history: CommandHistory, fold: NDArray[np.int64], rear_axle_m: float | None = None
    ) -> None:
        is_steered = rear_axle_m is None or len(np.unique(history.levels[:, 2])) > 1
        self.rear_axle_m = 0.0 if is_steered or rear_axle_m is None else rear_axle_m
        self.folds, self.sqrt_weight = [np.flatnonzero(fold == f) for f in range(FOLDS)], np.sqrt(rates.weight)
        drive, axles = _dummies(history.levels[:, 0]), [_dummies(history.levels[:, k]) for k in (1, 2)]
        self.absorbed = [self._orthogonal(of) for of in ([drive], axles if is_steered else [], axles)]
        values = self._at_rear_axle({k: rates.value[:, k] for k in range(3)})
        self.values = [self._without_maps(k, winsorised(values[k])) for k in range(3)]
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

    def _at_rear_axle(self, columns: Columns) -> Columns:
        if not self.rear_axle_m or 2 not in columns:
            return columns
        return columns | {1: columns.get(1, 0.0) - self.rear_axle_m * columns[2]}

    def gain(self, columns: Columns) -> tuple[float, Floats]:
        """Return the log likelihood gain of `columns` in the folds left out, and their coefficients from all folds."""
        projected = {k: self._without_maps(k, c) / self.size[k] for k, c in self._at_rear_axle(columns).items()}
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
