"""Whether the residuals of repeats have a common sign: a bias, whatever the scatter of each group.

The lack-of-fit test measures residuals in units of the predicted scatter. A cause outside the model widens the variance
components, and with them the scatter that is predicted for groups on which it does not act: their bias is then no lack
of fit, however large. Repeats without a bias end as often on one side as on the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.residuals.repeatability import groups_of_repeats
from agvbench.types import Floats

_FLIPS = 9999


def bias_p_value(ends: Floats, group: NDArray[np.int64]) -> float | None:
    """Return the p-value of the test that no group of repeats has a bias; None if no run has a repeat.

    The statistic is the sum over groups of the share of the squared residuals that the mean residual explains. Each
    group has its own scatter, and none dominates. Its distribution is that under random signs of the runs' residuals,
    which holds for residuals that are symmetric about zero and independent (Good, Permutation, Parametric, and
    Bootstrap Tests of Hypotheses, 2005, section 3.2).

    Parameters
    ----------
    ends
        (R, 2): residuals of the end positions, along and across the initial heading [m].
    group
        (R,): the group of each run.
    """
    parts = [own for runs in groups_of_repeats(group) if np.any(own := ends[runs])]
    if not parts:
        return None
    rng, observed, flipped = np.random.default_rng([0xB1A5, 0]), 0.0, np.zeros(_FLIPS)
    for own in parts:
        squares = len(own) * float(np.sum(own**2))
        signs = rng.integers(0, 2, (_FLIPS, len(own))) * 2.0 - 1.0
        observed += float(np.sum(own.sum(axis=0) ** 2)) / squares
        flipped += np.sum((signs @ own) ** 2, axis=1) / squares
    return float((1.0 + np.count_nonzero(flipped >= observed - 1e-9)) / (_FLIPS + 1.0))
