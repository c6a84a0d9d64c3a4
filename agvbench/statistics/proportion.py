"""A proportion of outcomes with its exact confidence bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

CONFIDENCE = 0.95


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
