"""Labels of figures: the number (colour, marker, place) of a condition, and titles of trajectories."""

from __future__ import annotations

import math
from collections.abc import Mapping

from agvbench.plot.style import condition_numbers
from agvbench.reporting.content import plain
from agvbench.types import Pose

__all__ = ["condition_numbers", "legend", "panel_title"]


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
