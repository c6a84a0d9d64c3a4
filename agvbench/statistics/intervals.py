"""Confidence intervals: bootstrap of medians (seeded), Welch's of means, exact bounds of proportions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agvbench.signals import medians
from agvbench.types import Floats

RESAMPLES = 4000
CONFIDENCE = 0.95
FEWEST = 3


class Interval(NamedTuple):
    """An estimate with its confidence interval; the bounds are NaN where there are too few values."""

    estimate: float
    low: float
    high: float

    def covers(self, value: float) -> bool:
        """Whether `value` lies inside."""
        return self.low <= value <= self.high


def median_interval(values: Floats, *, resamples: int = RESAMPLES, seed: int = 0) -> Interval:
    """Return the median of `values`, shape (n,), with its percentile bootstrap interval."""
    medians = _resampled_medians(values, resamples, np.random.default_rng(seed))
    return _interval(float(np.median(values)), medians)


def median_difference_interval(a: Floats, b: Floats, *, resamples: int = RESAMPLES, seed: int = 0) -> Interval:
    """Return median(b) − median(a) with its percentile bootstrap interval.

    The percentile interval, not BCa: the acceleration that BCa estimates by jackknife is not consistent for a median,
    whose jackknife values take only two distinct values. With 10 + 10 values of normal, heavy-tailed or skewed noise
    the nominal 95 % cover 96 %.

    Parameters
    ----------
    a, b
        Independent samples of shapes (n,) and (m,), finite. Fewer than three of either give NaN bounds.
    resamples
        How many bootstrap samples are drawn.
    seed
        The same seed and values give the same interval.

    Examples
    --------
    >>> a = np.arange(10.0)
    >>> median_difference_interval(a, a + 20.0).covers(20.0)
    True
    """
    rng = np.random.default_rng(seed)
    difference = _resampled_medians(b, resamples, rng) - _resampled_medians(a, resamples, rng)
    if min(len(a), len(b)) < FEWEST:
        difference = np.full(1, np.nan)
    return _interval(float(np.median(b) - np.median(a)), difference)


def average_difference_interval(
    strata: Sequence[tuple[Floats, Floats]], *, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Return the average over strata ``(a, b)`` of median(b) − median(a), with its interval.

    Every stratum is resampled within itself and weighs the same.
    """
    rng = np.random.default_rng(seed)
    estimates = [float(np.median(b) - np.median(a)) for a, b in strata]
    resampled = [_resampled_medians(b, resamples, rng) - _resampled_medians(a, resamples, rng) for a, b in strata]
    return _interval(float(np.mean(estimates)), np.mean(resampled, axis=0))


def _resampled_medians(values: Floats, resamples: int, rng: np.random.Generator) -> Floats:
    if len(values) < FEWEST:
        return np.full(resamples, np.nan)
    return medians(values[rng.integers(0, len(values), (resamples, len(values)))]).astype(float)


def _interval(estimate: float, resampled: Floats) -> Interval:
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(resampled, [tail, 100.0 - tail])
    return Interval(estimate, float(low), float(high))


def mean_difference_interval(a: Floats, b: Floats) -> Interval:
    """Return mean(b) − mean(a) with Welch's interval (1947); NaN bounds where a side has fewer than two values.

    >>> shift = mean_difference_interval(np.array([0.0, 1.0, 2.0]), np.array([10.0, 11.0, 12.0]))
    >>> shift.estimate, round(shift.low, 2), round(shift.high, 2)
    (10.0, 7.73, 12.27)
    """
    from scipy.special import stdtrit

    estimate = float(np.mean(b) - np.mean(a))
    if min(len(a), len(b)) < 2:
        return Interval(estimate, math.nan, math.nan)
    squares = [float(np.var(side, ddof=1)) / len(side) for side in (a, b)]
    total = sum(squares)
    if total == 0.0:
        return Interval(estimate, estimate, estimate)
    freedom = total**2 / sum(s**2 / (len(side) - 1) for s, side in zip(squares, (a, b), strict=True))
    half = float(stdtrit(freedom, 0.5 + CONFIDENCE / 2.0)) * math.sqrt(total)
    return Interval(estimate, estimate - half, estimate + half)


@dataclass(frozen=True)
class Proportion:
    """``count`` of ``total``, with the bounds that hold with 95 % confidence (Clopper and Pearson 1934).

    Examples
    --------
    >>> share = Proportion.of([True] * 10)
    >>> share.value, round(share.low, 3), share.high
    (1.0, 0.692, 1.0)
    """

    count: int
    total: int
    low: float
    high: float

    @classmethod
    def of(cls, outcomes: Iterable[bool]) -> Proportion:
        """Return the share of outcomes that are true."""
        from scipy.stats import binomtest

        found = list(outcomes)
        if not found:
            return cls(0, 0, 0.0, 1.0)
        interval = binomtest(sum(found), len(found)).proportion_ci(CONFIDENCE, method="exact")
        return cls(sum(found), len(found), float(interval.low), float(interval.high))

    @property
    def value(self) -> float:
        """The share itself; NaN of nothing."""
        return self.count / self.total if self.total else math.nan


def failure_bound(failures: int, total: int) -> float:
    """Return the one-sided 95 % upper bound of a failure probability (Clopper and Pearson 1934); NaN of no attempts.

    With no failure in n attempts it is 1 − 0.05^(1/n).

    >>> round(failure_bound(0, 10), 4), round(failure_bound(0, 59), 4)
    (0.2589, 0.0495)
    """
    from scipy.special import betaincinv  # not scipy.stats, which takes half a second to import

    if not total:
        return math.nan
    return float(betaincinv(failures + 1, total - failures, CONFIDENCE)) if failures < total else 1.0
