"""What a trajectory is called in figures."""

from __future__ import annotations

import math

from agvbench.reporting.content import plain
from agvbench.types import Pose


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
