"""Standard errors of parameters: by how much they move when groups of runs are left out, one after another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special  # scipy.stats takes a second to import

from agvbench.diagnosis.estimation.cross_validation import by_group, clustered_covariance
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.likelihood import ridge
from agvbench.types import Floats

_FEWEST = 4.0
_LEVEL = 0.975


def standard_errors(fitted: Fit, group: NDArray[np.int64]) -> Floats:
    """Return the standard errors of all parameters (P,).

    The larger of two jackknifes: by groups of runs that share a command, since what repeats share is not to be counted
    many times (MacKinnon, Nielsen and Webb, Journal of Applied Econometrics 38, 2023, CV3), and by runs, since few
    groups may agree by chance (Angrist and Pischke, Mostly Harmless Econometrics, 2009, section 8.2). Leaving out is
    one Newton step, exact as far as the loss is quadratic. So that ± 1.96 of it are a 95 % interval though few groups
    determine it, it is wider by Student's t. Where fewer than four groups determine a parameter, their dispersion shows
    nothing: then it is the larger of the likelihood's own standard error and that of the jackknife by runs. Windows of
    free driving, which come in few sessions, have those of `clustered_covariance`.

    Parameters
    ----------
    fitted
        The fit.
    group
        (R,): which runs belong together.
    """
    if fitted.predictor.readings.initial_states is not None:
        return np.asarray(np.sqrt(np.diagonal(clustered_covariance(fitted, group))))
    of_groups, counts = _jackknife(fitted, group)
    of_runs, _ = _jackknife(fitted, np.arange(len(group)))
    own = np.sqrt(np.diagonal(fitted.covariance))
    # Normal draws of n groups with the same variance have a fourth moment that makes them count as n/3.
    wider = special.stdtrit(3.0 * counts, _LEVEL) / special.ndtri(_LEVEL)
    jackknifed = np.maximum(of_groups, of_runs) * wider
    return np.asarray(np.where(counts >= _FEWEST, jackknifed, np.maximum(own, of_runs)))


def _jackknife(fitted: Fit, group: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the jackknife's standard errors (P,), and how many groups, in effect, determine each parameter (P,)."""
    pulls, information = by_group(fitted.gradient, group), by_group(fitted.information.dense(), group)
    groups = len(pulls)
    rest = information.sum(axis=0) + ridge(fitted.predictor) - information
    squares = np.array([np.linalg.lstsq(rest[g], pulls[g], rcond=1e-12)[0] for g in range(groups)]) ** 2
    counts = squares.sum(axis=0) ** 2 / np.maximum((squares**2).sum(axis=0), 1e-300)
    return np.sqrt((groups - 1) / groups * squares.sum(axis=0)), counts
