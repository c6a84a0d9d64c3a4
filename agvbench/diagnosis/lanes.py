"""Where the differences between variants of runs go: by the maps' values, and by each run's own offsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Gathering:
    """Which of n terms add up to each of u sums.

    ``order`` (n,): the terms as they are added; ``first`` (u,): where each sum begins in that order; ``place`` (u, q):
    the numbers that stand for each sum.
    """

    order: Integers
    first: Integers
    place: Integers

    @classmethod
    def of(cls, *place: Integers) -> Gathering:
        """Return what gathers terms by their numbers, q arrays (n,); within a sum they keep their order."""
        order = np.lexsort(place[::-1])
        ordered = np.column_stack(place)[order]
        first = np.flatnonzero(np.any(np.diff(ordered, axis=0, prepend=-1) != 0, axis=1))
        return cls(order, first, ordered[first])

    def sums(self, terms: Floats) -> Floats:
        """Return the sums (u, …) of terms (n, …)."""
        ordered = terms[self.order]
        return ordered if len(self.first) == len(ordered) else np.add.reduceat(ordered, self.first, axis=0)


@dataclass(frozen=True)
class Lanes:
    """The variants of runs in which one level (or one free value) of one command is changed, n of them.

    ``lane`` (n,): which lanes these are; ``run`` (n,): of which run; ``row`` (n,): a row that has the level, or the
    number of the value. ``term`` (t,) and ``weight`` (t,): whose change counts how much for each derivative by a free
    value. ``by_run`` gathers lanes, ``by_value`` terms by run and column.
    """

    lane: Integers
    run: Integers
    row: Integers
    term: Integers
    weight: Floats
    by_run: Gathering
    by_value: Gathering

    @classmethod
    def of(cls, lane: Integers, run: Integers, row: Integers, weights: Floats, column: Integers) -> Lanes:
        """Return lanes whose changes count by `weights` (n, values) in the columns (runs, values) of their runs."""
        term, value = np.nonzero(weights)
        by_value = Gathering.of(run[term], column[run[term], value])
        return cls(lane, run, row, term, weights[term, value], Gathering.of(run), by_value)
