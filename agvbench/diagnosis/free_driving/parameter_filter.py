"""The Kalman filter of parameters that vary: a slow and a fast part of each, from the residuals of earlier windows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.model.compiled import compiled
from agvbench.types import Floats

DEGREES_OF_FREEDOM = 4.0
"""Of Student's t distribution of residuals: few windows are far off, such as those in which a wheel spins."""

_OUTPUTS = 3
_WITH_POSE = DEGREES_OF_FREEDOM + _OUTPUTS

_Work = tuple[Floats, Floats, Floats]
"""The derivatives by the state times its covariance (3, n), a Cholesky factor (3, 3), and an innovation (3,)."""


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
    # The state has the slow parts, then the fast ones: the first parameters are sums of both.
    by_state = np.concatenate((slopes, slopes[:, :, : len(fast)]), axis=2)
    work = np.empty((_OUTPUTS, states)), np.empty((_OUTPUTS, _OUTPUTS)), np.empty(_OUTPUTS)
    pending, used_s = 0, -math.inf
    for i in range(count):
        if restarts[i]:
            _begin(state, covariance, slow, fast)
            pending, used_s = i, -math.inf
        else:
            while pending < i and ends_s[pending] <= begins_s[i]:
                if begins_s[pending] >= used_s and not np.isnan(residual[pending, 0]):
                    _update(state, covariance, residual[pending], by_state[pending], variance[pending], work)
                    used_s = ends_s[pending]
                pending += 1
            _drift(state, covariance, slow, fast, times_s, max(begins_s[i] - begins_s[i - 1], 0.0))
        _estimate(state, covariance, math.exp(-ahead_s / times_s[1]), estimates[i])
        density[i] = 0.0
        if not np.isnan(residual[i, 0]):
            density[i] = _log_density(state, covariance, residual[i], by_state[i], variance[i], work)


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
def _update(
    state: Floats, covariance: Floats, residual: Floats, by_state: Floats, variance: Floats, work: _Work
) -> None:
    """Update the state by the residual (3,) of a window."""
    shared, root, whitened = work
    _whiten(state, covariance, residual, by_state, variance, work)
    widened = max((DEGREES_OF_FREEDOM + _squared(whitened)) / _WITH_POSE, 1.0)
    if widened > 1.0:
        _whiten(state, covariance, residual, by_state, widened * variance, work)
    for k in range(len(state)):
        _solve(root, shared[:, k])
    for k in range(len(state)):
        for a in range(_OUTPUTS):
            state[k] += shared[a, k] * whitened[a]
            for j in range(len(state)):
                covariance[k, j] -= shared[a, k] * shared[a, j]


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
def _log_density(
    state: Floats, covariance: Floats, residual: Floats, by_state: Floats, variance: Floats, work: _Work
) -> float:
    """Return the logarithm of the predictive density of the residual (3,) of a window, but for a constant."""
    _, root, whitened = work
    _whiten(state, covariance, residual, by_state, variance, work)
    volume = 2.0 * math.log(root[0, 0] * root[1, 1] * root[2, 2])
    return -0.5 * (volume + _WITH_POSE * math.log1p(_squared(whitened) / DEGREES_OF_FREEDOM))


@compiled()
def _whiten(
    state: Floats, covariance: Floats, residual: Floats, by_state: Floats, variance: Floats, work: _Work
) -> None:
    """Compute the innovation in units of its standard deviations, by the Cholesky factor of its covariance.

    Plain loops: with calls of LAPACK for matrices of this size, the filter took four times as long.
    """
    shared, root, whitened = work
    for a in range(_OUTPUTS):
        whitened[a] = residual[a]
        for k in range(len(state)):
            whitened[a] -= by_state[a, k] * state[k]
            shared[a, k] = 0.0
            for j in range(len(state)):
                shared[a, k] += by_state[a, j] * covariance[j, k]
    for a in range(_OUTPUTS):
        for b in range(a + 1):
            left = variance[a] if a == b else 0.0
            for k in range(len(state)):
                left += shared[a, k] * by_state[b, k]
            for c in range(b):
                left -= root[a, c] * root[b, c]
            root[a, b] = math.sqrt(left) if a == b else left / root[b, b]
    _solve(root, whitened)


@compiled()
def _solve(root: Floats, values: Floats) -> None:
    """Divide `values` (3,) by the lower triangular matrix `root` (3, 3), in place."""
    for a in range(_OUTPUTS):
        for b in range(a):
            values[a] -= root[a, b] * values[b]
        values[a] /= root[a, a]


@compiled()
def _squared(whitened: Floats) -> float:
    """Return the squared Mahalanobis distance of a whitened innovation (3,)."""
    return float(whitened[0] ** 2 + whitened[1] ** 2 + whitened[2] ** 2)
