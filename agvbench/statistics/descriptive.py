"""Descriptive statistics: minimum, quartiles, maximum, and outliers by Tukey's fences (not dropped)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agvbench.types import Floats


class FiveNumbers(NamedTuple):
    """Minimum, first quartile, median, third quartile and maximum."""

    minimum: float
    q1: float
    median: float
    q3: float
    maximum: float


def five_numbers(values: Floats) -> FiveNumbers:
    """Return the five numbers of `values`, shape (n,), n ≥ 1.

    Quartiles interpolate linearly between the two nearest values (Hyndman and Fan's type 7). The thesis does not say
    which rule it used; its quartiles of headings, read to 0.1°, lie on steps of 0.025° (5.875°), as this rule gives
    for ten readings.

    >>> five_numbers(np.array([4.0, 1.0, 3.0, 2.0]))
    FiveNumbers(minimum=1.0, q1=1.75, median=2.5, q3=3.25, maximum=4.0)
    """
    return FiveNumbers(*map(float, np.percentile(values, [0, 25, 50, 75, 100])))


FEWEST = 5


@dataclass(frozen=True)
class Outliers:
    """How many values lie beyond Tukey's fences: mild beyond 1.5, severe beyond 3 interquartile ranges."""

    low_severe: int
    low_mild: int
    high_mild: int
    high_severe: int

    @property
    def count(self) -> int:
        """Return how many there are of all four kinds."""
        return self.low_severe + self.low_mild + self.high_mild + self.high_severe

    def __str__(self) -> str:
        return ", ".join(f"{n} {kind.replace('_', ' ')}" for kind, n in vars(self).items() if n) or "none"


def classify_outliers(values: Floats) -> Outliers:
    """Return how many of `values`, shape (n,), are outliers, by side and severity.

    Fewer than five values have no quartiles worth fencing: none is called an outlier.

    >>> str(classify_outliers(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 30.0])))
    '1 high severe'
    """
    if len(values) < FEWEST:
        return Outliers(0, 0, 0, 0)
    q1, q3 = np.percentile(values, [25, 75])
    mild, severe = 1.5 * (q3 - q1), 3.0 * (q3 - q1)
    low_severe, high_severe = int(np.sum(values < q1 - severe)), int(np.sum(values > q3 + severe))
    return Outliers(
        low_severe,
        int(np.sum(values < q1 - mild)) - low_severe,
        int(np.sum(values > q3 + mild)) - high_severe,
        high_severe,
    )
