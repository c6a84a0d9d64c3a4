"""How well a fitted model predicts groups of runs that it was not fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.fit import Fit, loss_at
from agvbench.types import Floats

FOLDS = 5
_BEST_SHARE = 0.05
_CLEAR = 1e-4
_OWN_SHARE = 0.01


def cross_validated(fitted: Fit, fold: NDArray[np.int64], bounds: Floats) -> Floats:
    """Return each run's loss (R,) under the parameters that the other folds determine.

    About the optimum the loss is quadratic, run by run, so that leaving a fold out is a solution of the normal
    equations without its share: one Newton step from the parameters of all runs, exact as far as the loss is quadratic.
    A parameter at its bound stays there. What only the fold itself determines is fitted to the fold: a level driven
    nowhere else is calibration. Nor can the other folds predict backlash that one group alone goes through both ways:
    everywhere else levels of the maps compensate it. That is a matter of directions and not of single parameters: those
    of which the other folds hold less than a hundredth of the information.
    """
    if fitted.predictor.readings.initial_states is not None:
        return _cross_validated_windows(fitted, fold, bounds)
    maps = fitted.predictor.maps.size
    effects = fitted.parameters[maps:]
    free = np.ones(len(fitted.parameters), dtype=np.bool_)
    free[maps:] = (effects > bounds[:, 0]) & (effects < bounds[:, 1])
    among = np.ix_(free, free)
    gradient = fitted.gradient[:, free]
    total = fitted.information.total[among]
    weak = 1e-6 * np.diag(np.diagonal(total) + 1.0)
    whiten = np.linalg.inv(np.linalg.cholesky(total + weak)).T
    loss = fitted.loss.copy()
    for k in np.unique(fold):
        out = fold == k
        # Where all runs together know each direction equally well, the fold knows what the others lack.
        share, turn = np.linalg.eigh(whiten.T @ (fitted.information.total_of(~out)[among] + weak) @ whiten)
        turn = whiten @ turn
        others, own = (turn.T @ gradient[chosen].sum(axis=0) for chosen in (~out, out))
        known = share > _OWN_SHARE
        move = np.zeros(len(free))
        move[free] = turn @ np.where(
            known, others / np.maximum(share, _OWN_SHARE), own / np.maximum(1.0 - share, _OWN_SHARE)
        )
        loss[out] += (fitted.information.along(move) - 2.0 * fitted.gradient @ move)[out]
    return loss


def _cross_validated_windows(fitted: Fit, fold: NDArray[np.int64], bounds: Floats) -> Floats:
    """Return each window's loss (W,) under the effects that the other folds determine.

    A fold is another session or recording, with levels of its own: maps are calibrated on all of them, for what is
    asked is whether effects found elsewhere hold here. The loss is far from quadratic, so it is simulated anew.
    """
    maps, count = fitted.predictor.maps.size, len(fitted.parameters)
    loss = fitted.loss.copy()
    if maps == count:
        return loss
    total = fitted.information.total + np.eye(count)
    for k in np.unique(fold):
        out = fold == k
        others = fitted.information.total_of(~out) + np.eye(count) * np.r_[np.ones(maps), np.full(count - maps, 1e-4)]
        step = np.linalg.lstsq(others, fitted.gradient[~out].sum(axis=0), rcond=1e-12)[0]
        moved = fitted.parameters.copy()
        moved[maps:] = np.clip(moved[maps:] + step[maps:], bounds[:, 0], bounds[:, 1])
        change = moved[maps:] - fitted.parameters[maps:]
        moved[:maps] -= np.linalg.lstsq(total[:maps, :maps], total[:maps, maps:] @ change, rcond=1e-12)[0]
        loss[out] = loss_at(fitted, moved)[out]
    return loss


def without_best(gain: Floats, group: NDArray[np.int64], share: float = _BEST_SHARE) -> float:
    """Return what is left of the total `gain` (R,) without the best `share` of groups, at least one of them.

    A true cause helps wherever it acts; a gain that sits in one group of runs is that group's own trouble.
    """
    gains = by_group(gain, group)
    best = np.sort(gains)[::-1][: max(1, round(share * len(gains)))]
    return float(gains.sum() - best.sum())


def clustered_covariance(fitted: Fit, group: NDArray[np.int64]) -> Floats:
    """Return the covariance of the parameters (P, P), with the pull of each group of runs taken as one draw.

    What a run's samples share, and what repeats of a command share, is then not counted many times (the sandwich of
    Liang and Zeger, 1986). Where it is the smaller, the likelihood's own covariance is kept.
    """
    pulls, own = by_group(fitted.gradient, group), fitted.covariance
    maps = fitted.predictor.maps.size
    spare = max(len(group) - maps, 1)
    robust = own @ (pulls.T @ pulls * len(group) / spare) @ own
    widen = np.sqrt(np.maximum(np.diagonal(robust) / np.maximum(np.diagonal(own), 1e-300), 1.0))
    return np.asarray(own * widen[:, None] * widen[None, :])


def by_group(values: Floats, group: NDArray[np.int64]) -> Floats:
    """Return the sums of runs' `values` (R, …) by group, (G, …)."""
    _, index = np.unique(group, return_inverse=True)
    sums = np.zeros((int(index.max()) + 1, *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def differs_from_nothing(fitted: Fit, name: str, group: NDArray[np.int64]) -> bool:
    """Return whether the parameters of the effect called `name` are clear of what does nothing (Wald's test).

    Limits, whose null is infinite, are judged by their gain alone.
    """
    from scipy import special

    predictor = fitted.predictor
    own = np.array([key.partition(".")[0] == name for key in predictor.parameter_names])
    at = predictor.maps.size + np.flatnonzero(own)
    nulls = predictor.nulls[own]
    if not np.isfinite(nulls).all():
        return True
    off = fitted.parameters[at] - nulls
    covariance = clustered_covariance(fitted, group)[np.ix_(at, at)]
    statistic = float(off @ np.linalg.pinv(covariance, hermitian=True) @ off)
    return bool(special.chdtrc(len(at), statistic) < _CLEAR)
