"""What so many repeats can show: the smallest visible difference, and how many repeats it takes to speak."""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from agvbench.statistics.rank_test import critical_pairs

POWER = 0.9
_DRAWS = 2000
_MOST_SIMULATED = 100


def smallest_visible_difference(sd: float, n_a: int, n_b: int, *, alpha: float, power: float = POWER) -> float:
    """Return which shift a one-sided rank-sum test of n_a against n_b repeats finds with probability `power`.

    Infinite where even full separation would not be significant. For normal noise; about the same for heavier tails.

    Parameters
    ----------
    sd
        Standard deviation of one repeat; the result has its unit.
    n_a, n_b
        Repeats of either sample.
    alpha
        One-sided level after correction for other comparisons.
    """
    if smallest_p(n_a, n_b) > alpha:
        return math.inf
    return sd * (_simulated if n_a + n_b <= _MOST_SIMULATED else _approximated)(n_a, n_b, alpha, power)


def smallest_p(n_a: int, n_b: int) -> float:
    """Return the smallest one-sided p-value of a rank-sum test without ties.

    >>> round(smallest_p(5, 5), 5)
    0.00397
    >>> smallest_p(660, 660)
    0.0
    """
    # Whole numbers divide into 0.0 where there are more orders than a float can count; 1.0 over them would not.
    return 1 / math.comb(n_a + n_b, n_a)


def fewest_repeats(alpha: float) -> int:
    """Return how many repeats on either side it takes before a rank-sum test can be significant at `alpha`.

    >>> fewest_repeats(0.05 / 8)
    5
    """
    return next(n for n in range(1, 1000) if smallest_p(n, n) <= alpha)


@lru_cache(maxsize=256)
def _simulated(n_a: int, n_b: int, alpha: float, power: float) -> float:
    """Return the shift in standard deviations, over seeded draws of the two samples.

    A shift is found where it exceeds as many of the differences a − b as the test demands, so that every draw has
    one least shift that is found, and the share `power` of the draws has it below the result.
    """
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((_DRAWS, n_a, 1)), rng.standard_normal((_DRAWS, 1, n_b))
    apart = (a - b).reshape(_DRAWS, n_a * n_b)
    demanded = critical_pairs(n_a, n_b, alpha) - 1
    return float(np.quantile(np.partition(apart, demanded, axis=1)[:, demanded], power))


def _approximated(n_a: int, n_b: int, alpha: float, power: float) -> float:
    # The rank-sum test needs π/3 times the repeats of a t test on normal noise.
    quantile = NormalDist().inv_cdf(1.0 - alpha) + NormalDist().inv_cdf(power)
    return quantile * math.sqrt(math.pi / 3.0 * (1.0 / n_a + 1.0 / n_b))
