"""Which number (colour, marker, place) a condition has: the same in every figure of every report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agvbench.reporting.content import plain
from agvbench.types import CONDITIONS


def condition_numbers(conditions: Sequence[str]) -> dict[str, int]:
    """Return the number of every condition; the known ones keep theirs whether the others are there or not.

    >>> condition_numbers(["calibrated", "by_hand"])
    {'calibrated': 1, 'by_hand': 3}
    """
    others = [condition for condition in conditions if condition not in CONDITIONS]
    known = {c: CONDITIONS.index(c) for c in conditions if c in CONDITIONS}
    return known | {c: len(CONDITIONS) + index for index, c in enumerate(others)}


def legend(numbers: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return what a figure's legend names; nothing where runs have no conditions.

    >>> legend({"calibrated": 1, "": 3}), legend({"": 3})
    ([('calibrated', 1), ('no condition', 3)], [])
    """
    return [(plain(name) or "no condition", number) for name, number in numbers.items()] if any(numbers) else []
