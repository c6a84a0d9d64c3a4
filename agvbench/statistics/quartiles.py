"""Minimum, quartiles and maximum, as tables 8.3–8.10 of the thesis give them."""

from __future__ import annotations

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
