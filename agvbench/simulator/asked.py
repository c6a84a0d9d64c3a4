"""What a plant is asked: poses and commands, checked in one place for every plant that ships."""

from __future__ import annotations

import math

from agvbench.errors import PlantError

LONGEST_ADVANCE_S = 86_400.0


def asked_pose(pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a pose to be reset to (m, m, rad) as plain floats.

    Raises
    ------
    PlantError
        If it is not finite.
    """
    x, y, heading = (float(value) for value in pose)
    if not math.isfinite(x + y + heading):
        raise PlantError(
            "start pose is not finite", where="reset", value=tuple(pose), remedy="give x, y in m and heading in rad"
        )
    return x, y, heading


def asked_advance(drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float, float]:
    """Return a command and how long to hold it [s] as plain floats.

    Raises
    ------
    PlantError
        If a command is not a finite number, or `dt` is negative, not finite or over a day.
    """
    try:
        drive, front, rear, dt = float(drive), float(front), float(rear), float(dt)
    except (TypeError, ValueError):
        raise PlantError("command is not a number", where="advance", value=(drive, front, rear, dt)) from None
    if not math.isfinite(drive + front + rear):
        raise PlantError("command is not finite", where="advance", value=f"drive {drive}, front {front}, rear {rear}")
    if not 0.0 <= dt <= LONGEST_ADVANCE_S:
        raise PlantError(
            "time step is out of range", where="advance", value=f"{dt} s", limit=f"0 to {LONGEST_ADVANCE_S:.0f} s"
        )
    return drive, front, rear, dt
