"""Starting and stopping after section 8.1: how far a drive goes that is told a time."""

from __future__ import annotations

import math

from agvbench.workflows.thesis.assumptions import Ramps

# 0.0 to 0.3 m/s in 0.294 s, and 0.32 to 0.02 m/s in 0.588 s.
ACCELERATION_MPS2 = 0.3 / 0.294
BRAKING_MPS2 = (0.32 - 0.02) / 0.588
# 8.1 sees "a small increase in velocity" after braking and gives no size: this is the most one would call small.
REBOUND_MPS = 0.1


def driven_distance(speed_mps: float, duration_s: float, ramps: Ramps) -> float:
    """Return the signed distance [m] driven at steady `speed_mps`, started and stopped as `ramps` says.

    Constant acceleration loses v²/2a at the start and constant braking adds v²/2b after the stop command; the
    rebound goes back by v_r²/b, up to its peak and down again at the rate of braking.

    >>> round(1000 * (driven_distance(0.32, 6.25, "accelerate_and_brake") - 2.0), 1)
    50.2
    """
    speed = abs(speed_mps)
    distance = speed * duration_s
    if ramps != "none":
        distance += 0.5 * speed**2 * (1.0 / BRAKING_MPS2 - 1.0 / ACCELERATION_MPS2)
    if ramps == "with_rebound":
        distance -= min(REBOUND_MPS, speed) ** 2 / BRAKING_MPS2
    return math.copysign(distance, speed_mps)
