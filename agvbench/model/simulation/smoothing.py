# mypy: warn-return-any=False
"""A camera that smooths: m′ = (q − m) / lag, where q is the true pose that it measures.

Within a step q is the polynomial through its values at the step's start and at the nodes, and m follows in closed form.
In steps much shorter than the lag the closed form would cancel, and quadrature replaces it.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.model.compiled import compiled
from agvbench.types import Floats

_COUNT = 4
_POWERS = _COUNT + 1
_GAUSS = np.polynomial.legendre.leggauss(_COUNT)
_NODES, _WEIGHTS = 0.5 + 0.5 * _GAUSS[0], 0.5 * _GAUSS[1]
#: From values at a step's start and nodes to coefficients of 1, share, share² …
_TO_POWERS = np.linalg.inv(np.vander(np.concatenate((np.zeros(1), _NODES)), _POWERS, increasing=True))

# Coefficients of q: x, y and heading in sequence.
SMOOTH_SIZE = 3 * _POWERS
# Shortest step, in time constants, for which the closed form does not cancel.
_LONG = 0.2


@compiled(inner=True)
def bend(work: Floats, at: int) -> None:
    """Convert values of q at the start and the nodes of a step to polynomial coefficients, for x, y and heading."""
    for channel in range(at, at + SMOOTH_SIZE, _POWERS):
        first, a, b, c, d = work[channel], work[channel + 1], work[channel + 2], work[channel + 3], work[channel + 4]
        a, b, c, d = a - first, b - first, c - first, d - first
        for k in range(1, _POWERS):
            row = _TO_POWERS[k]
            work[channel + k] = row[1] * a + row[2] * b + row[3] * c + row[4] * d


@compiled(inner=True)
def smoothed(work: Floats, channel: int, before: float, lags: float, share: float) -> float:
    """Return m after a share of a step of length `lags` (in time constants), with `before` at its start."""
    decay = math.exp(-lags * share)
    q0, q1, q2, q3, q4 = work[channel], work[channel + 1], work[channel + 2], work[channel + 3], work[channel + 4]
    if lags >= _LONG:
        p4 = q4
        p3 = q3 - 4.0 / lags * p4
        p2 = q2 - 3.0 / lags * p3
        p1 = q1 - 2.0 / lags * p2
        p0 = -p1 / lags
        return q0 + p0 + share * (p1 + share * (p2 + share * (p3 + share * p4))) + decay * (before - q0 - p0)
    integral = 0.0
    for i in range(_COUNT):
        u = share * _NODES[i]
        value = u * (q1 + u * (q2 + u * (q3 + u * q4)))
        integral += _WEIGHTS[i] * math.exp(-lags * (share - u)) * value
    return q0 + lags * share * integral + decay * (before - q0)
