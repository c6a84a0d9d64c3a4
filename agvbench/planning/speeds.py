"""How a trajectory says how fast: ``"full"``, ``"half"``, a share such as ``"75%"``, or metres per second.

A speed is what the *drive command* sets, that of the axles. The centroid's follows from the steering angles (thesis
eq. 5.6), a little slower in turns. So a trajectory with one speed has one drive command, and a change of steering
is a change of steering only.
"""

from __future__ import annotations

import math
import re

from agvbench.errors import PlanError

Speed = float | str
_SHARES = {"full": 1.0, "half": 0.5}
_PER_CENT = re.compile(r"(\d+(?:\.\d+)?)\s*%")


def share_of(speed: str) -> float | None:
    """Return the share of full speed that `speed` names, or None if it names none.

    >>> share_of("half"), share_of("75%"), share_of("slow")
    (0.5, 0.75, None)
    """
    if speed in _SHARES:
        return _SHARES[speed]
    match = _PER_CENT.fullmatch(speed)
    share = float(match[1]) / 100.0 if match else 0.0
    return share if 0.0 < share <= 1.0 else None


def check_speed(speed: Speed) -> None:
    """Raise ValueError, with a line for the user, unless `speed` is one."""
    if isinstance(speed, str):
        if share_of(speed) is None:
            raise ValueError(f'speed is not a speed: {speed!r} (limit: "full", "half", a share "1%" to "100%", or m/s)')
    elif not (math.isfinite(speed) and speed > 0.0):
        raise ValueError(f'speed is not above zero: {speed} m/s; to drive backward say direction = "backward"')


def axle_speed(speed: Speed, full_mps: float, *, where: str) -> float:
    """Return the axle speed [m/s, positive] that `speed` means for a vehicle whose full speed is `full_mps`.

    Raises
    ------
    PlanError
        If the vehicle does not go so fast, or no one knows how fast it goes.
    """
    if isinstance(speed, str):
        if not math.isfinite(full_mps):
            raise PlanError(
                f"what {speed} speed is is not known: the drive's map has no end", where=where, remedy="say it in m/s"
            )
        share = share_of(speed)
        assert share is not None  # noqa: S101 - checked when the trajectory was read
        return share * full_mps
    if speed > full_mps * (1.0 + 1e-9):
        raise PlanError(
            "speed is more than the drive reaches",
            where=where,
            value=f"{speed:g} m/s",
            limit=f"{full_mps:.3f} m/s",
            remedy='slow down, or say "full"',
        )
    return min(speed, full_mps)
