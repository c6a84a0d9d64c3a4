"""Wilcoxon's rank-sum (Mann–Whitney) test: exact with ties, and over several strata at once.

The null distribution is that of all ways to deal the pooled ranks out to the two samples (a permutation test), counted
exactly by the shift algorithm of Streitberg and Röhmel (1986), so that ties and small samples need no approximation.
Independent strata (trajectories, sessions) are tested together by adding their statistics, whose exact null
distribution is the convolution of theirs. Beyond 100 values in a stratum, or strata whose statistics would take more
than 20000 values together, the normal approximation with its correction for ties takes over.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats

_MOST_EXACT = 100
_WIDEST_EXACT = 20_000


@dataclass(frozen=True)
class RankTest:
    """One-sided p-values of a rank-sum test of b against a.

    ``p_greater`` is small if b tends to be larger; ``p_less`` if smaller; ``least_p`` is the smallest p-value that
    samples of this size and ties can give at all. ``superiority`` is P(b > a) + P(b = a) / 2, Vargha and Delaney's A₁₂.
    """

    p_greater: float
    p_less: float
    least_p: float
    superiority: float


def rank_test(strata: Sequence[tuple[Floats, Floats]]) -> RankTest:
    """Test whether b tends to be larger or smaller than a, over all strata ``(a, b)`` together.

    Parameters
    ----------
    strata
        One pair of samples, shapes (n,) and (m,), per stratum; values are compared only within a stratum. Strata in
        which either sample is empty say nothing and are skipped.

    Examples
    --------
    >>> test = rank_test([(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))])
    >>> round(test.p_greater, 6), test.p_less, test.superiority
    (0.05, 1.0, 1.0)
    """
    counted = [_Stratum(a, b) for a, b in strata if len(a) and len(b)]
    if not counted:
        return RankTest(1.0, 1.0, 1.0, 0.5)
    statistic = sum(stratum.twice_u for stratum in counted)
    pairs = sum(stratum.pairs for stratum in counted)
    exact = max(s.size for s in counted) <= _MOST_EXACT and 2 * pairs <= _WIDEST_EXACT
    p_greater, p_less, least = (_exact if exact else _normal)(counted, statistic, 2 * pairs)
    return RankTest(p_greater, p_less, least, statistic / (2 * pairs))


def critical_pairs(n_a: int, n_b: int, alpha: float) -> int:
    """Return in how many of the n_a n_b pairs b must be larger to be significant at one-sided `alpha`, without ties.

    One more than there are pairs where no outcome is significant.

    >>> critical_pairs(5, 5, 0.01), critical_pairs(5, 5, 0.001)
    (24, 26)
    """
    twice_ranks = tuple(range(2, 2 * (n_a + n_b) + 1, 2))
    probability = _distribution(twice_ranks, n_b)[::2]
    upper = np.cumsum(probability[::-1])[::-1]
    significant = np.flatnonzero(upper <= alpha * (1.0 + 1e-9))
    return int(significant[0]) if len(significant) else n_a * n_b + 1


class _Stratum:
    """Twice Mann–Whitney's U of one stratum (an integer even with ties) and what its null distribution needs."""

    def __init__(self, a: Floats, b: Floats) -> None:
        twice_ranks = _twice_ranks(np.concatenate([a, b]))
        self.n_b, self.size, self.pairs = len(b), len(a) + len(b), len(a) * len(b)
        self.twice_u = int(twice_ranks[len(a) :].sum()) - self.n_b * (self.n_b + 1)
        self.sorted_ranks = tuple(np.sort(twice_ranks).tolist())

    def variance(self) -> float:
        # Of twice U under permutation: sampling n_b of the ranks without replacement.
        return self.pairs * float(np.var(self.sorted_ranks)) / (self.size - 1)


def _twice_ranks(values: Floats) -> NDArray[np.int64]:
    """Return twice the mid-ranks, which are integers."""
    ordered = np.sort(values)
    return np.searchsorted(ordered, values, "left") + np.searchsorted(ordered, values, "right") + 1


@lru_cache(maxsize=256)
def _distribution(sorted_twice_ranks: tuple[int, ...], n_b: int) -> Floats:
    """Return the probability of twice U = 0, 1, …, 2 n_a n_b under permutation."""
    total, lowest = sum(sorted_twice_ranks), n_b * (n_b + 1)
    ways = np.zeros((n_b + 1, total + 1))
    ways[0, 0] = 1.0
    for seen, rank in enumerate(sorted_twice_ranks, start=1):
        # From the most values dealt down, so that each rank is dealt at most once.
        for dealt in range(min(seen, n_b), 0, -1):
            ways[dealt, rank:] += ways[dealt - 1, : total + 1 - rank]
    pairs = n_b * (len(sorted_twice_ranks) - n_b)
    counts = ways[n_b, lowest : lowest + 2 * pairs + 1]
    return np.asarray(counts / counts.sum())


def _exact(strata: Sequence[_Stratum], statistic: int, highest: int) -> tuple[float, float, float]:
    upper, lower, least = _tails(tuple((stratum.sorted_ranks, stratum.n_b) for stratum in strata))
    return min(1.0, float(upper[statistic])), min(1.0, float(lower[min(statistic, highest)])), least


@lru_cache(maxsize=256)
def _tails(strata: tuple[tuple[tuple[int, ...], int], ...]) -> tuple[Floats, Floats, float]:
    """Return P(statistic ≥ k) and P(statistic ≤ k) for every k, and the smaller of the probabilities at the ends."""
    probability = reduce(np.convolve, (_distribution(*stratum) for stratum in strata))
    reached = np.flatnonzero(probability > 0.0)
    least = float(min(probability[reached[0]], probability[reached[-1]]))
    return np.cumsum(probability[::-1])[::-1], np.cumsum(probability), least


def _normal(strata: Sequence[_Stratum], statistic: int, highest: int) -> tuple[float, float, float]:
    sd = math.sqrt(sum(stratum.variance() for stratum in strata))
    if sd == 0.0:
        return 1.0, 1.0, 1.0
    away = statistic - highest / 2

    def tail(distance: float) -> float:
        # Half a step of U (one of twice U) as the correction for continuity.
        return 0.5 * math.erfc((distance - 1.0) / sd / math.sqrt(2.0))

    return min(1.0, tail(away)), min(1.0, tail(-away)), tail(highest / 2)
