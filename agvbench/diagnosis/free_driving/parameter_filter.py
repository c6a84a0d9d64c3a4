"""The Kalman filter of parameters that vary: a slow and a fast part of each, from the residuals of earlier windows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.model.compiled import compiled
from agvbench.types import Floats

DEGREES_OF_FREEDOM = 4.0
"""Of Student's t distribution of residuals: few windows are far off, such as those in which a wheel spins."""


@compiled()
def filter_parameters(
    restarts: NDArray[np.bool_],
    begins_s: Floats,
    ends_s: Floats,
    residual: Floats,
    slopes: Floats,
    variance: Floats,
    slow: Floats,
    fast: Floats,
    times_s: Floats,
    ahead_s: float,
    estimates: Floats,
    density: Floats,
) -> None:
    """Estimate the parameters at the beginning of each window from the windows that ended before it.

    Each parameter is the sum of a random walk and of a first-order autoregressive process (Ornstein–Uhlenbeck), both
    zero in the mean (Durbin and Koopman 2012, Time series analysis by state space methods, chapters 3 and 4). A
    residual far from its prediction counts less, by the weight of Student's t distribution. Windows that overlap one
    that was used are left out, because their residuals are correlated.

    Parameters
    ----------
    restarts
        (W,): whether a window is the first of its recording: nothing is known of it. Windows of a recording are in the
        order of time.
    begins_s, ends_s
        (W,): begin of each window, and time of the pose to which its residual belongs.
    residual
        (W, 3): measured minus predicted pose; NaN if there is none.
    slopes
        (W, 3, m): its derivatives by the parameters.
    variance
        (W, 3): variance of the residual for other reasons than the parameters.
    slow, fast
        (m,): variance of the slow part between recordings, and of the fast part.
    times_s
        (2,): time in which the slow part drifts by its standard deviation between recordings, and time constant of the
        fast part.
    ahead_s
        Time ahead for which the fast part is predicted.
    estimates
        (W, 2, m): receives the estimates and their standard errors.
    density
        (W,): receives the logarithm of the predictive density of each residual, zero if there is none.
    """
    count, m = slopes.shape[0], slopes.shape[2]
    state, covariance = np.zeros(2 * m), np.zeros((2 * m, 2 * m))
    both = np.zeros((3, 2 * m))
    degrees = DEGREES_OF_FREEDOM + 3.0
    pending, used_s = 0, -math.inf
    for i in range(count):
        if restarts[i]:
            state[:] = 0.0
            covariance[:] = 0.0
            for k in range(m):
                covariance[k, k], covariance[m + k, m + k] = slow[k], fast[k]
            pending, used_s = i, -math.inf
        else:
            while pending < i and ends_s[pending] <= begins_s[i]:
                j = pending
                pending += 1
                if begins_s[j] < used_s or np.isnan(residual[j, 0]):
                    continue
                used_s = ends_s[j]
                both[:, :m], both[:, m:] = slopes[j], slopes[j]
                innovation = residual[j] - both @ state
                known = both @ covariance @ both.T
                squared = _squared_distance(innovation, known, variance[j], 1.0)
                widened = max((DEGREES_OF_FREEDOM + squared) / degrees, 1.0)
                inverse = np.linalg.inv(_total(known, variance[j], widened))
                gain = covariance @ both.T @ inverse
                state = state + gain @ innovation
                covariance = covariance - gain @ (both @ covariance)
            passed_s = max(begins_s[i] - begins_s[i - 1], 0.0)
            kept = math.exp(-passed_s / times_s[1])
            for k in range(m):
                state[m + k] *= kept
                covariance[m + k, :] *= kept
                covariance[:, m + k] *= kept
                covariance[k, k] += slow[k] * passed_s / times_s[0]
                covariance[m + k, m + k] += fast[k] * (1.0 - kept * kept)
        ahead = math.exp(-ahead_s / times_s[1])
        for k in range(m):
            estimates[i, 0, k] = state[k] + ahead * state[m + k]
            own = covariance[k, k] + 2.0 * ahead * covariance[k, m + k] + ahead * ahead * covariance[m + k, m + k]
            estimates[i, 1, k] = math.sqrt(max(own, 0.0))
        density[i] = 0.0
        if not np.isnan(residual[i, 0]):
            both[:, :m], both[:, m:] = slopes[i], slopes[i]
            known = both @ covariance @ both.T
            total = _total(known, variance[i], 1.0)
            squared = _squared_distance(residual[i] - both @ state, known, variance[i], 1.0)
            density[i] = -0.5 * (math.log(np.linalg.det(total)) + degrees * math.log1p(squared / DEGREES_OF_FREEDOM))


@compiled()
def _total(known: Floats, variance: Floats, widened: float) -> Floats:
    """Return the covariance (3, 3) of a residual: of the parameters, and of what else there is."""
    total = known.copy()
    for a in range(3):
        total[a, a] += widened * variance[a]
    return total


@compiled()
def _squared_distance(innovation: Floats, known: Floats, variance: Floats, widened: float) -> float:
    """Return the squared Mahalanobis distance of an innovation (3,)."""
    return float(innovation @ np.linalg.inv(_total(known, variance, widened)) @ innovation)
