"""Cross-validation over groups of runs, and covariances and tests clustered by group."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.fit import Fit, loss_at
from agvbench.types import Floats

FOLDS = 5
_MIN_SHARE = 0.05  # of the information about a direction; a fold holds 0.2 on average


def cross_validated(fitted: Fit, fold: NDArray[np.int64], bounds: Floats) -> Floats:
    """Return each run's loss (R,) at the parameters that are estimated from the other folds.

    Leaving a fold out is one Newton step from the parameters of all runs: the normal equations are solved without the
    fold's contribution. The step is exact if the loss of each run is quadratic. Parameters at a bound stay there.

    Directions in parameter space for which the other folds hold less than 5 % of the information are fitted to the
    fold itself, because the other folds cannot predict them: a misfit elsewhere would be amplified twentyfold. One
    example is a command level that is driven in no other fold, which is calibration. Another is a backlash that a
    single group traverses in both directions, while the nodal values compensate for it in all other groups. The prior
    of the maps counts as information of the other folds, but not as a share: it says less than a single run. So do the
    priors of effects, which are observations that belong to no fold.

    Other runs predict a run no better than the fit to all of them does. Where the steps say so, the iteration has
    stopped at a kink of the loss, of which the quadratic approximation knows nothing: the loss of the fit is returned.
    """
    if fitted.predictor.readings.initial_states is not None:
        return _cross_validated_windows(fitted, fold, bounds)
    maps = fitted.predictor.maps.size
    effects = fitted.parameters[maps:]
    free = np.ones(len(fitted.parameters), dtype=np.bool_)
    free[maps:] = (effects > bounds[:, 0]) & (effects < bounds[:, 1])
    among = np.ix_(free, free)
    gradient = fitted.gradient[:, free]
    prior, prior_gradient = fitted.prior.information[among], fitted.prior.gradient[free]
    total = fitted.information.total[among]
    weak = 1e-6 * np.diag(np.diagonal(total) + 1.0)
    whiten = np.linalg.inv(np.linalg.cholesky(total + weak)).T
    loss = fitted.loss.copy()
    for k in np.unique(fold):
        out = fold == k
        # In coordinates in which the total information is the identity, the fold holds what the others lack.
        share, turn = eigenvectors(whiten.T @ (fitted.information.total_of(~out)[among] + weak) @ whiten)
        turn = whiten @ turn
        known = share > _MIN_SHARE
        by_prior = turn.T @ prior @ turn
        others, own = (turn.T @ (gradient[chosen].sum(axis=0) + prior_gradient) for chosen in (~out, out))
        along = own / (np.maximum(1.0 - share, _MIN_SHARE) + np.diagonal(by_prior))
        matrix = np.diag(share[known]) + by_prior[np.ix_(known, known)]
        along[known] = np.linalg.solve(matrix, others[known])
        move = np.zeros(len(free))
        move[free] = turn @ along
        loss[out] += (fitted.information.along(move) - 2.0 * fitted.gradient @ move)[out]
    return loss if loss.sum() >= fitted.loss.sum() else fitted.loss.copy()


def eigenvectors(matrix: Floats) -> tuple[Floats, Floats]:
    """Return the eigenvalues (n,) and eigenvectors (n, n) of a symmetric matrix (n, n) by QR iterations.

    LAPACK's divide and conquer, which NumPy calls, may not converge where nearly all eigenvalues are 1.
    """
    values, vectors = eigh(matrix, driver="ev")
    return values, vectors


def _cross_validated_windows(fitted: Fit, fold: NDArray[np.int64], bounds: Floats) -> Floats:
    """Return each window's loss (W,) with the effects that are estimated from the other folds.

    A fold is a session or a recording with its own drive level. The maps are therefore calibrated on all folds, and
    only the effects are cross-validated. The loss is far from quadratic, so it is evaluated by a new simulation.
    """
    maps, count = fitted.predictor.maps.size, len(fitted.parameters)
    loss = fitted.loss.copy()
    if maps == count:
        return loss
    total = fitted.information.total + fitted.prior.information + np.eye(count)
    for k in np.unique(fold):
        out = fold == k
        weak = np.eye(count) * np.r_[np.ones(maps), np.full(count - maps, 1e-4)]
        others = fitted.information.total_of(~out) + fitted.prior.information + weak
        gradient = fitted.gradient[~out].sum(axis=0) + fitted.prior.gradient
        step = np.linalg.lstsq(others, gradient, rcond=1e-12)[0]
        moved = fitted.parameters.copy()
        moved[maps:] = np.clip(moved[maps:] + step[maps:], bounds[:, 0], bounds[:, 1])
        change = moved[maps:] - fitted.parameters[maps:]
        moved[:maps] -= np.linalg.lstsq(total[:maps, :maps], total[:maps, maps:] @ change, rcond=1e-12)[0]
        loss[out] = loss_at(fitted, moved)[out]
    return loss


def trimmed_gain(gain: Floats, group: NDArray[np.int64], share: float = SELECTION.trimmed_share) -> float:
    """Return the total of `gain` (R,) without the `share` of groups with the largest gain and that with the smallest.

    At least one group is left out at each end. A true cause improves the prediction of all groups on which it acts,
    whereas a gain in a single group is an artefact of that group. So may be a loss in a single group: its nodal values
    then compensate for a cause that is still missing. The mean trimmed at both ends is a robust estimate of location;
    trimmed at the upper end alone it is biased towards a loss (Wilcox, Introduction to Robust Estimation and Hypothesis
    Testing, 2012, section 3.3).

    With fewer than three groups the result is 0.
    """
    gains = np.sort(by_group(gain, group))
    out = max(1, round(share * len(gains)))
    return float(gains[out:-out].sum())


def clustered_covariance(fitted: Fit, group: NDArray[np.int64]) -> Floats:
    """Return the cluster-robust covariance of the parameters (P, P), with groups of runs as clusters.

    It allows for correlation between the samples of a run and between repeats of a command (sandwich estimator, Liang
    and Zeger 1986). The priors of effects are independent observations. No standard error is smaller than that of the
    likelihood.
    """
    scores, own = by_group(fitted.gradient, group), fitted.covariance
    maps = fitted.predictor.maps.size
    spare = max(len(group) - maps, 1)
    robust = own @ (scores.T @ scores * len(group) / spare) @ own + fitted.covariance_by_priors
    widen = np.sqrt(np.maximum(np.diagonal(robust) / np.maximum(np.diagonal(own), 1e-300), 1.0))
    return np.asarray(own * widen[:, None] * widen[None, :])


def by_group(values: Floats, group: NDArray[np.int64]) -> Floats:
    """Return the sums of runs' `values` (R, …) by group, (G, …)."""
    _, index = np.unique(group, return_inverse=True)
    sums = np.zeros((int(index.max()) + 1, *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def differs_from_null(fitted: Fit, name: str, group: NDArray[np.int64]) -> bool:
    """Return whether the parameters of the effect called `name` differ significantly from null (Wald's test).

    The null value of a limit is infinity: its inverse is tested against zero, with the standard error that the delta
    method propagates.
    """
    at, nulls = _parameters_of(fitted, name), fitted.predictor.nulls
    off = fitted.parameters[at] - nulls[at - fitted.predictor.maps.size]
    slope, limits = np.ones(len(at)), np.isinf(off)
    off[limits] = 1.0 / fitted.parameters[at][limits]
    slope[limits] = -(off[limits] ** 2)
    covariance = clustered_covariance(fitted, group)[np.ix_(at, at)] * slope[:, None] * slope
    return _is_significant(float(off @ np.linalg.pinv(covariance, hermitian=True) @ off), len(at))


def fits_better(without: Fit, fitted: Fit, name: str, group: NDArray[np.int64]) -> bool:
    """Return whether `fitted` is significantly better than a fit `without` the effect called `name`.

    Parameters that only together are known are far from null, and Wald's statistic is small, where the likelihood falls
    steeply towards null (Hauck and Donner 1977, Journal of the American Statistical Association 72). The likelihood
    ratio does not depend on the parametrisation. It is divided by the mean factor by which clusters widen the variances
    (Rotnitzky and Jewell 1990, Biometrika 77).
    """
    at = _parameters_of(fitted, name)
    own, clustered = (np.diagonal(c)[at] for c in (fitted.covariance, clustered_covariance(fitted, group)))
    widened = float(np.mean(clustered / np.maximum(own, 1e-300)))
    return _is_significant((without.total_loss - fitted.total_loss) / widened, len(at))


def _parameters_of(fitted: Fit, name: str) -> NDArray[np.int64]:
    """Return the indices of the parameters of an effect."""
    own = [key.partition(".")[0] == name for key in fitted.predictor.parameter_names]
    return fitted.predictor.maps.size + np.flatnonzero(own)


def _is_significant(statistic: float, freedom: int) -> bool:
    from scipy import special

    return bool(special.chdtrc(freedom, max(statistic, 0.0)) < SELECTION.wald_alpha)
