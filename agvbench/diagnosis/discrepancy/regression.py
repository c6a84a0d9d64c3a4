"""Residual rates ready for regression on shapes, with what the maps' own levels can absorb removed.

Residuals are weighted by the misfit itself: by the cameras' noise everything would look certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.types import Floats

FOLDS = 5

_LEAST = 1e-9
_OUTLIER, _NEARLY_ALL = 3.0, 0.99

Columns = dict[int, Floats]
"""Regressors (n, q) by feature: 0 longitudinal, 1 lateral, 2 turning."""


@dataclass(frozen=True)
class SteeringTangents:
    """Tangents of both axles' settled angles (n, 2) at each residual rate, ``before`` under the command before.

    ``levels`` (n, 3): which level of drive, front and rear was in force.
    """

    tangent: Floats
    before: Floats
    levels: NDArray[np.int64]


def steering(batch: Batch, parameters: Floats, rates: Rates) -> SteeringTangents:
    """Return how the axles stood at each rate, by the maps' values in `parameters`."""
    where = batch.maps.slices()
    settled = np.column_stack([batch.weights[role] @ parameters[where[role]] for role in ("front", "rear")])
    tangent = np.tan(np.clip(settled, -1.4, 1.4))
    before = tangent.copy()
    for k, role in enumerate(("front", "rear")):
        command = batch.commands[role]
        for row in range(1, len(command)):
            if batch.base.row_runs[row] == batch.base.row_runs[row - 1]:
                same = command[row] == command[row - 1]
                before[row, k] = before[row - 1, k] if same else tangent[row - 1, k]
    rows = np.empty(len(rates.run), dtype=np.int64)
    for r in np.unique(rates.run):
        own = rates.run == r
        at = np.searchsorted(batch.readings.runs[r].commands.t_s, rates.covariates["time_in_run_s"][own], side="right")
        rows[own] = batch.base.row_starts[r] + at
    levels = np.column_stack(
        [np.unique(batch.commands[role], return_inverse=True)[1][rows] for role in ("drive", "front", "rear")]
    )
    return SteeringTangents(tangent[rows], before[rows], levels)


class GroupedRegression:
    """Residual rates ready for regression: what maps absorb removed, each feature in units of its misfit."""

    def __init__(self, rates: Rates, stands: SteeringTangents, fold: NDArray[np.int64]) -> None:
        self.folds, self.root = [np.flatnonzero(fold == f) for f in range(FOLDS)], np.sqrt(rates.weight)
        drive, axles = _dummies(stands.levels[:, 0]), [_dummies(stands.levels[:, k]) for k in (1, 2)]
        self.known = [self._orthogonal([drive]), *[self._orthogonal(axles)] * 2]
        self.values = [self._clean(k, _without_outliers(rates.value[:, k])) for k in range(3)]
        self.size = [max(float(np.sqrt(np.mean(v * v))), _LEAST) for v in self.values]
        self.values = [v / s for v, s in zip(self.values, self.size, strict=True)]
        self.count = len(np.unique(rates.run))

    def _orthogonal(self, blocks: Sequence[Floats]) -> Floats:
        matrix = np.column_stack([np.ones(len(self.root)), *blocks]) * self.root[:, None]
        left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
        return np.asarray(left[:, singular > 1e-8 * singular[0]])

    def _clean(self, k: int, columns: Floats) -> Floats:
        weighted = (columns.T * self.root).T
        return np.asarray(weighted - self.known[k] @ (self.known[k].T @ weighted))

    def gain(self, columns: Columns) -> tuple[float, Floats]:
        """Return the log likelihood that `columns` gain in folds left out, and their sizes fitted to all."""
        clean = {k: self._clean(k, c) / self.size[k] for k, c in columns.items()}
        forms, pulls = (np.array(of) for of in zip(*(self._products(k, c) for k, c in clean.items()), strict=True))
        of_folds, pulls_of_folds = forms.sum(axis=0), pulls.sum(axis=0)
        matrix, pull = of_folds.sum(axis=0), pulls_of_folds.sum(axis=0)
        ridge = (1e-9 * np.trace(matrix) + 1e-300) * np.eye(len(pull))
        # Fitted to all, then without each fold.
        left, pulls_left = np.concatenate([matrix[None], matrix - of_folds]), np.vstack([pull, pull - pulls_of_folds])
        sizes = np.linalg.solve(left + ridge, pulls_left[..., None])[..., 0]
        others = sizes[1:]
        change = np.einsum("fi,kfij,fj->k", others, forms, others) - 2.0 * np.einsum("kfi,fi->k", pulls, others)
        gain = -np.log(np.maximum(1.0 + change / len(self.root), _LEAST)).sum()
        return float(0.5 * self.count * gain), sizes[0]

    def _products(self, k: int, columns: Floats) -> tuple[Floats, Floats]:
        """Return by fold the products of columns (n, q) with each other (folds, q, q), and with feature `k`."""
        parts = [(columns[own], self.values[k][own]) for own in self.folds]
        return np.array([c.T @ c for c, _ in parts]), np.array([c.T @ v for c, v in parts])


def _without_outliers(value: Floats) -> Floats:
    """Return the values (n,), those far beyond nearly all others cut: one run gone astray must not drown the rest."""
    limit = _OUTLIER * float(np.quantile(np.abs(value - np.median(value)), _NEARLY_ALL))
    return np.clip(value, np.median(value) - limit, np.median(value) + limit)


def _dummies(level: NDArray[np.int64]) -> Floats:
    return np.asarray((level[:, None] == np.unique(level)[None, :]).astype(np.float64))
