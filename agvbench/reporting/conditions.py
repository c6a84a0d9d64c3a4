"""Which number (colour, marker, place) a condition has: the same in every figure of every report."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.types import CONDITIONS


def condition_numbers(conditions: Sequence[str]) -> dict[str, int]:
    """Return the number of every condition; the known ones keep theirs whether the others are there or not.

    >>> condition_numbers(["calibrated", "by_hand"])
    {'calibrated': 1, 'by_hand': 3}
    """
    others = [condition for condition in conditions if condition not in CONDITIONS]
    known = {c: CONDITIONS.index(c) for c in conditions if c in CONDITIONS}
    return known | {c: len(CONDITIONS) + index for index, c in enumerate(others)}
