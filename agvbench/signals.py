"""Statistics of measured signals that several layers need."""

from __future__ import annotations

import numpy as np

from agvbench.types import Floats

MAD_TO_STD = 1.4826
"""Standard deviation of a normal distribution in units of the median of its absolute deviations (1/Φ⁻¹(3/4))."""


def robust_std(residual: Floats) -> float:
    """Return the standard deviation of residuals (n,) about zero, from the median of their absolute values.

    Nearly half of them may be outliers.

    >>> robust_std(np.array([-1.0, 1.0, 1.0, 500.0]))
    1.4826
    """
    return MAD_TO_STD * float(np.median(np.abs(residual)))
