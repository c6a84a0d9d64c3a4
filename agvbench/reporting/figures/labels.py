"""Labels of figures: the number (colour, marker, place) of a condition, and titles of trajectories."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from agvbench.reporting.content import plain
from agvbench.types import CONDITIONS, Pose


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


def panel_title(name: str, target: Pose) -> str:
    """Return the trajectory's name and where it leads, in the start frame.

    >>> panel_title("6", Pose(1.0, -1.0, -math.pi / 2))
    '6: to (1, −1) m, −90°'
    """
    if not name:
        return ""
    numbers = (target.x_m, target.y_m, math.degrees(target.heading_rad))
    x, y, heading = (f"{value + 0.0:.3g}".replace("-", "−") for value in numbers)
    return plain(f"{name}: to ({x}, {y}) m, {heading}°")
