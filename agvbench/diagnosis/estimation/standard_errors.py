"""Standard errors of parameters, from jackknives over groups of runs and over runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special  # scipy.stats takes a second to import

from agvbench.diagnosis.estimation.cross_validation import by_group, clustered_covariance
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.types import Floats

_MIN_GROUPS = 4.0
_LEVEL = 0.975


def standard_errors(fitted: Fit, group: NDArray[np.int64]) -> Floats:
    """Return the standard errors of all parameters (P,).

    The standard error is the larger of two jackknife estimates. The first leaves out groups of runs with the same
    commands, because errors that repeats share must not count once per repeat (CV3: MacKinnon, Nielsen and Webb,
    Journal of Applied Econometrics 38, 2023). The second leaves out single runs, because a few groups may agree by
    chance (Angrist and Pischke, Mostly Harmless Econometrics, 2009, section 8.2). Leaving out is one Newton step, which
    is exact for a quadratic loss.

    Student's t for the effective number of groups widens the standard error, so that ± 1.96 standard errors are a 95 %
    interval. If fewer than four groups determine a parameter, their standard deviation is not informative. Its standard
    error is then the larger of those of the likelihood and of the jackknife over runs. Windows of free driving come in
    few sessions; their standard errors are those of `clustered_covariance`. No jackknife leaves out a prior of an
    effect: its standard deviation is added, as far as the estimate depends on it.

    Parameters
    ----------
    fitted
        The fit.
    group
        (R,): the group of each run.
    """
    if fitted.predictor.readings.initial_states is not None:
        return np.asarray(np.sqrt(np.diagonal(clustered_covariance(fitted, group))))
    of_groups, counts = _jackknife(fitted, group)
    of_runs, _ = _jackknife(fitted, np.arange(len(group)))
    own, by_priors = np.sqrt(np.diagonal(fitted.covariance)), np.sqrt(np.diagonal(fitted.covariance_by_priors))
    # For normal deviations of n groups with equal variance the effective number is n/3.
    widening = special.stdtrit(3.0 * counts, _LEVEL) / special.ndtri(_LEVEL)
    widened = np.hypot(np.maximum(of_groups, of_runs) * widening, by_priors)
    return np.asarray(np.where(counts >= _MIN_GROUPS, widened, np.maximum(own, np.hypot(of_runs, by_priors))))


def _jackknife(fitted: Fit, group: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the jackknife standard errors (P,), and the effective number of groups behind each of them (P,)."""
    scores, information = by_group(fitted.gradient, group), by_group(fitted.information.dense(), group)
    groups = len(scores)
    rest = fitted.total_information - information
    squares = np.array([np.linalg.lstsq(rest[g], scores[g], rcond=1e-12)[0] for g in range(groups)]) ** 2
    counts = squares.sum(axis=0) ** 2 / np.maximum((squares**2).sum(axis=0), 1e-300)
    return np.sqrt((groups - 1) / groups * squares.sum(axis=0)), counts
