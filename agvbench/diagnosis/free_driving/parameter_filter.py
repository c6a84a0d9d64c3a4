"""The Kalman filter of parameters that vary: a slow and a fast part of each, from the residuals of earlier windows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.model.compiled import compiled
from agvbench.types import Floats

DEGREES_OF_FREEDOM = 4.0
"""Of Student's t distribution of residuals: few windows are far off, such as those in which a wheel spins."""

_WITH_POSE = DEGREES_OF_FREEDOM + 3.0


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

    Each parameter is a random walk, and the first ones are the sum of one and of a first-order autoregressive process
    (Ornstein–Uhlenbeck), all zero in the mean (Durbin and Koopman 2012, Time series analysis by state space methods,
    chapters 3 and 4). A residual far from its prediction counts less, by the weight of Student's t distribution.
    Windows that overlap one that was used are left out, because their residuals are correlated.

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
        (m,): variance of the slow part between recordings; (f,): variance of the fast part of the first f parameters.
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
    count, states = slopes.shape[0], len(slow) + len(fast)
    state, covariance = np.zeros(states), np.zeros((states, states))
    pending, used_s = 0, -math.inf
    for i in range(count):
        if restarts[i]:
            _begin(state, covariance, slow, fast)
            pending, used_s = i, -math.inf
        else:
            while pending < i and ends_s[pending] <= begins_s[i]:
                if begins_s[pending] >= used_s and not np.isnan(residual[pending, 0]):
                    _update(state, covariance, residual[pending], slopes[pending], variance[pending])
                    used_s = ends_s[pending]
                pending += 1
            _drift(state, covariance, slow, fast, times_s, max(begins_s[i] - begins_s[i - 1], 0.0))
        _estimate(state, covariance, math.exp(-ahead_s / times_s[1]), estimates[i])
        density[i] = 0.0
        if not np.isnan(residual[i, 0]):
            density[i] = _log_density(state, covariance, residual[i], slopes[i], variance[i])


@compiled()
def _begin(state: Floats, covariance: Floats, slow: Floats, fast: Floats) -> None:
    """Set the state at the beginning of a recording: the slow parts (m,), then the fast ones (f,)."""
    state[:] = 0.0
    covariance[:] = 0.0
    for k in range(len(slow)):
        covariance[k, k] = slow[k]
    for k in range(len(fast)):
        covariance[len(slow) + k, len(slow) + k] = fast[k]


@compiled()
def _by_state(slopes: Floats, state: Floats) -> Floats:
    """Return the derivatives (3, m + f) by the state (m + f,), from those by the parameters (3, m)."""
    return np.concatenate((slopes, slopes[:, : len(state) - slopes.shape[1]]), axis=1)


@compiled()
def _drift(state: Floats, covariance: Floats, slow: Floats, fast: Floats, times_s: Floats, passed_s: float) -> None:
    """Let the slow parts walk, and the fast ones decay, for the time `passed_s`."""
    m = len(slow)
    kept = math.exp(-passed_s / times_s[1])
    for k in range(m):
        covariance[k, k] += slow[k] * passed_s / times_s[0]
    for k in range(len(fast)):
        state[m + k] *= kept
        covariance[m + k, :] *= kept
        covariance[:, m + k] *= kept
        covariance[m + k, m + k] += fast[k] * (1.0 - kept * kept)


@compiled()
def _update(state: Floats, covariance: Floats, residual: Floats, slopes: Floats, variance: Floats) -> None:
    """Update the state by the residual (3,) of a window."""
    by_state = _by_state(slopes, state)
    innovation, known = residual - by_state @ state, by_state @ covariance @ by_state.T
    widened = max((DEGREES_OF_FREEDOM + _squared_distance(innovation, known, variance)) / _WITH_POSE, 1.0)
    gain = covariance @ by_state.T @ np.linalg.inv(_total(known, widened * variance))
    state += gain @ innovation
    covariance -= gain @ (by_state @ covariance)


@compiled()
def _estimate(state: Floats, covariance: Floats, ahead: float, estimate: Floats) -> None:
    """Write parameters and standard errors into `estimate` (2, m), with the share `ahead` of the fast parts."""
    m = estimate.shape[1]
    for k in range(m):
        estimate[0, k], own = state[k], covariance[k, k]
        if k < len(state) - m:
            estimate[0, k] += ahead * state[m + k]
            own += 2.0 * ahead * covariance[k, m + k] + ahead * ahead * covariance[m + k, m + k]
        estimate[1, k] = math.sqrt(max(own, 0.0))


@compiled()
def _log_density(state: Floats, covariance: Floats, residual: Floats, slopes: Floats, variance: Floats) -> float:
    """Return the logarithm of the predictive density of the residual (3,) of a window, but for a constant."""
    by_state = _by_state(slopes, state)
    known = by_state @ covariance @ by_state.T
    squared = _squared_distance(residual - by_state @ state, known, variance)
    volume = math.log(np.linalg.det(_total(known, variance)))
    return -0.5 * (volume + _WITH_POSE * math.log1p(squared / DEGREES_OF_FREEDOM))


@compiled()
def _total(known: Floats, variance: Floats) -> Floats:
    """Return the covariance (3, 3) of a residual: of the parameters, and of what else there is."""
    total = known.copy()
    for a in range(3):
        total[a, a] += variance[a]
    return total


@compiled()
def _squared_distance(innovation: Floats, known: Floats, variance: Floats) -> float:
    """Return the squared Mahalanobis distance of an innovation (3,)."""
    return float(innovation @ np.linalg.inv(_total(known, variance)) @ innovation)
