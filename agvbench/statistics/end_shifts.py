"""By how much the mean end position moved, with its direction: information beside the tests of errors.

An end position error may stay as it is while runs end on the other side of their target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agvbench.statistics.bootstrap import CONFIDENCE, Interval
from agvbench.statistics.cells import Cell
from agvbench.types import Floats


@dataclass(frozen=True)
class EndShift:
    """Mean end position of side b minus that of side a in one cell, along and across [mm], with 95 % intervals."""

    trajectory: str
    condition: str
    along: Interval
    across: Interval

    @property
    def length_mm(self) -> float:
        """Return how far the mean end position moved [mm]."""
        return math.hypot(self.along.estimate, self.across.estimate)


def end_shift(cell: Cell) -> EndShift:
    """Return the shift of the mean end position in `cell`."""
    along, across = (mean_difference_interval(cell.a.ends_mm[:, k], cell.b.ends_mm[:, k]) for k in (0, 1))
    return EndShift(cell.trajectory, cell.condition, along, across)


def mean_difference_interval(a: Floats, b: Floats, *, confidence: float = CONFIDENCE) -> Interval:
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
    half = float(stdtrit(freedom, 0.5 + confidence / 2.0)) * math.sqrt(total)
    return Interval(estimate, estimate - half, estimate + half)
