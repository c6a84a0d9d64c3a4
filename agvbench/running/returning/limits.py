"""How near a start is near enough, and how to drive there."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ReturnLimits:
    """How near is near enough, and how to drive there.

    A place within ``position_m`` [m] and ``heading_rad`` [rad] will do; what is aimed at is ``reserve`` of it, since a
    camera is noisy. ``fast_mps``, ``mean_mps`` and ``slow_mps`` [m/s] are the speeds of a way, of its last leg and of
    the last ``slow_m`` [m] of that. Errors die off over the way driven at such a speed in ``die_off_s`` [s], since
    servos, cameras and the bus take time. ``astray_m`` [m] off its path a vehicle stops, and another way is found.
    """

    position_m: float = 0.005
    heading_rad: float = math.radians(1.0)
    reserve: float = 0.8
    most_attempts: int = 12
    fast_mps: float = 0.20
    mean_mps: float = 0.14
    slow_mps: float = 0.06
    slow_m: float = 0.12
    steer_first_s: float = 0.5
    look_s: float = 0.5
    settle_limit_s: float = 6.0
    patience_s: float = 20.0
    die_off_s: float = 1.1
    astray_m: float = 0.3


DEFAULT_RETURN = ReturnLimits()
