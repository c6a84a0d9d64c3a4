"""Invert a monotone function numerically."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agvbench.types import Floats

_MAX_ITERATIONS = 100


def solve_monotone(
    function: Callable[[Floats], Floats],
    slope: Callable[[Floats], Floats],
    target: Floats,
    low: Floats,
    high: Floats,
) -> Floats:
    """Return x in [low, high] with ``function(x) = target``, for each element.

    Newton's method, kept inside a shrinking bracket and replaced by bisection wherever it would leave it: as
    safe as bisection where the slope vanishes, and quadratic elsewhere. `function` rises throughout, or falls
    throughout, between each pair of `low` and `high`, and takes `target` there.
    """
    low, high = low.copy(), high.copy()
    rising = function(high) >= function(low)
    x = 0.5 * (low + high)
    for _ in range(_MAX_ITERATIONS):
        residual = function(x) - target
        above = (residual > 0.0) == rising
        high = np.where(above, x, high)
        low = np.where(above, low, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x - residual / slope(x)
        inside = (newton > low) & (newton < high)
        following = np.where(residual == 0.0, x, np.where(inside, newton, 0.5 * (low + high)))
        if np.all(np.abs(following - x) <= 2.0 * np.spacing(np.abs(x))):
            return following
        x = following
    return x
