"""How well a fitted model predicts groups of runs that it was not fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.fitting import Fit
from agvbench.types import Floats

FOLDS = 5
_BEST_SHARE = 0.05


def cross_validated(fitted: Fit, fold: NDArray[np.int64], bounds: Floats) -> Floats:
    """Return each run's loss (R,) under the parameters that the other folds determine.

    About the optimum the loss is quadratic, run by run, so that leaving a fold out is a solution of the normal
    equations without its share: one Newton step from the parameters of all runs, exact as far as the loss is quadratic.
    A parameter at its bound stays there.
    """
    maps = fitted.predictor.maps.size
    own = fitted.parameters[maps:]
    free = np.ones(len(fitted.parameters), dtype=np.bool_)
    free[maps:] = (own > bounds[:, 0]) & (own < bounds[:, 1])
    information = fitted.information[:, free][:, :, free]
    gradient = fitted.gradient[:, free]
    weak = 1e-6 * np.diag(np.diagonal(information.sum(axis=0)) + 1.0)
    loss = fitted.loss.copy()
    for k in np.unique(fold):
        out = fold == k
        move = np.linalg.lstsq(information[~out].sum(axis=0) + weak, gradient[~out].sum(axis=0), rcond=1e-12)[0]
        loss[out] += -2.0 * gradient[out] @ move + np.einsum("rij,i,j->r", information[out], move, move)
    return loss


def without_best(gain: Floats, group: NDArray[np.int64]) -> float:
    """Return what is left of the total `gain` (R,) without the best twentieth of groups, at least one of them.

    A true cause helps wherever it acts; a gain that sits in one group of runs is that group's own trouble.
    """
    names, index = np.unique(group, return_inverse=True)
    by_group = np.bincount(index, weights=gain)
    best = np.sort(by_group)[::-1][: max(1, round(_BEST_SHARE * len(names)))]
    return float(by_group.sum() - best.sum())
