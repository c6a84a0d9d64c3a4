"""What so many repeats can show: the smallest visible difference, and how many repeats it takes to speak."""

from __future__ import annotations

import math
from statistics import NormalDist

POWER = 0.9
# The rank-sum test needs π/3 times the repeats of a t test on normal noise.
_RANK_COST = math.pi / 3.0


def smallest_visible_difference(sd: float, n_a: int, n_b: int, *, alpha: float, power: float = POWER) -> float:
    """Return about which shift a one-sided rank-sum test of n_a against n_b repeats finds with probability `power`.

    Infinite where even full separation would not be significant. Uses Student's t with the degrees of freedom of the
    two samples, in its Cornish–Fisher expansion; within 15 % of simulation for 5 to 30 repeats of normal noise.

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
    normal = NormalDist()
    quantile = _student_quantile(1.0 - alpha, n_a + n_b - 2) + normal.inv_cdf(power)
    return sd * quantile * math.sqrt(_RANK_COST * (1.0 / n_a + 1.0 / n_b))


def smallest_p(n_a: int, n_b: int) -> float:
    """Return the smallest one-sided p-value of a rank-sum test without ties.

    >>> round(smallest_p(5, 5), 5)
    0.00397
    """
    return 1.0 / math.comb(n_a + n_b, n_a)


def fewest_repeats(alpha: float) -> int:
    """Return how many repeats on either side it takes before a rank-sum test can be significant at `alpha`.

    >>> fewest_repeats(0.05 / 8)
    5
    """
    return next(n for n in range(1, 1000) if smallest_p(n, n) <= alpha)


def _student_quantile(probability: float, freedom: int) -> float:
    z = NormalDist().inv_cdf(probability)
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    return z + first / freedom + second / freedom**2 + third / freedom**3
