"""Hypothesis tests: Wilcoxon's rank-sum (Mann–Whitney) test, Holm's correction, and statistical power.

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
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats

_MOST_EXACT = 100
_WIDEST_EXACT = 20_000


@dataclass(frozen=True)
class RankTest:
    """One-sided p-values of a rank-sum test of b against a.

    ``p_greater`` is small if b tends to be larger; ``p_less`` if smaller; ``minimum_p`` is the smallest p-value that
    samples of this size and ties can give at all. ``superiority`` is P(b > a) + P(b = a) / 2, Vargha and Delaney's A₁₂.
    """

    p_greater: float
    p_less: float
    minimum_p: float
    superiority: float

    @property
    def cliffs_delta(self) -> float:
        """Cliff's delta, P(b > a) − P(b < a): positive where b tends to be larger."""
        return 2.0 * self.superiority - 1.0


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


def holm(p_values: Sequence[float]) -> list[float]:
    """Return Holm's (1979) adjusted p-values, in the order given.

    Rejecting where the adjusted value is at most α keeps the chance of any false rejection at or below α, whatever
    the dependence.

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return [float(value) for value in adjusted]


def hochberg(p_values: Sequence[float]) -> list[float]:
    """Return Hochberg's (1988) adjusted p-values, in the order given: none is corrected where all are significant.

    Rejecting where the adjusted value is at most α keeps the chance of any false rejection at or below α, for
    independent and for positively dependent tests. If all p-values are at most α, all are rejected, as by an
    intersection–union test.

    >>> hochberg([0.01, 0.04, 0.03])
    [0.03, 0.04, 0.04]
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(-p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, np.minimum.accumulate(p[order] * np.arange(1, len(p) + 1)))
    return [float(value) for value in adjusted]


def tarone_testable(minimum_p: Sequence[float], alpha: float) -> list[bool]:
    """Return which tests could reach significance at all after correction (Tarone, 1990).

    A test of few repeats has a smallest possible p-value. Tests whose smallest is above α / k, with k the least
    number for which at most k tests are not, are left out: they cannot be false alarms, so the others need not pay
    for them.

    >>> tarone_testable([0.2, 0.2, 0.001], alpha=0.05)
    [False, False, True]
    """
    least = np.asarray(minimum_p, dtype=float)
    k = next((k for k in range(1, len(least) + 1) if np.sum(least <= alpha / k) <= k), 1)
    return [bool(value <= alpha / k) for value in least]


def holm_tarone(p_values: Sequence[float], minimum_p: Sequence[float], alpha: float) -> list[float]:
    """Return Holm's adjusted p-values among the tests that are `tarone_testable`; 1 for the others."""
    testable_tests = tarone_testable(minimum_p, alpha)
    adjusted = iter(holm([p for p, testable in zip(p_values, testable_tests, strict=True) if testable]))
    return [next(adjusted) if testable else 1.0 for testable in testable_tests]


POWER = 0.9
_DRAWS = 2000
_MOST_SIMULATED = 100


def minimum_detectable_difference(sd: float, n_a: int, n_b: int, *, alpha: float) -> float:
    """Return which shift a one-sided rank-sum test of n_a against n_b repeats finds nine times in ten.

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
    if minimum_attainable_p(n_a, n_b) > alpha:
        return math.inf
    return sd * (_simulated if n_a + n_b <= _MOST_SIMULATED else _approximated)(n_a, n_b, alpha)


def minimum_attainable_p(n_a: int, n_b: int) -> float:
    """Return the smallest one-sided p-value of a rank-sum test without ties.

    >>> round(minimum_attainable_p(5, 5), 5)
    0.00397
    >>> minimum_attainable_p(660, 660)
    0.0
    """
    # Whole numbers divide into 0.0 where there are more orders than a float can count; 1.0 over them would not.
    return 1 / math.comb(n_a + n_b, n_a)


def required_sample_size(alpha: float) -> int:
    """Return how many repeats on either side it takes before a rank-sum test can be significant at `alpha`.

    >>> required_sample_size(0.05 / 8)
    5
    """
    return next(n for n in range(1, 1000) if minimum_attainable_p(n, n) <= alpha)


@lru_cache(maxsize=256)
def _simulated(n_a: int, n_b: int, alpha: float) -> float:
    """Return the shift in standard deviations, over seeded draws of the two samples.

    A shift is found where it exceeds as many of the differences a − b as the test demands, so that every draw has
    one least shift that is found, and the share `POWER` of the draws has it below the result.
    """
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((_DRAWS, n_a, 1)), rng.standard_normal((_DRAWS, 1, n_b))
    apart = (a - b).reshape(_DRAWS, n_a * n_b)
    demanded = critical_pairs(n_a, n_b, alpha) - 1
    return float(np.quantile(np.partition(apart, demanded, axis=1)[:, demanded], POWER))


def _approximated(n_a: int, n_b: int, alpha: float) -> float:
    # The rank-sum test needs π/3 times the repeats of a t test on normal noise.
    quantile = NormalDist().inv_cdf(1.0 - alpha) + NormalDist().inv_cdf(POWER)
    return quantile * math.sqrt(math.pi / 3.0 * (1.0 / n_a + 1.0 / n_b))
