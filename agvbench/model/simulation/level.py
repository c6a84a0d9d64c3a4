"""Where a simulation begins in mid-drive: the speed that was measured there, and the level of the drive from it.

A part of the kernel; see `agvbench.model.simulation.compose`.
"""

from __future__ import annotations

import math

from agvbench.effects.state import FORWARD, FRONT, HOURS, LEFT, REAR, SEEN_LAG, SPEED, TIME, YAW_RATE
from agvbench.model.compiled import compiled
from agvbench.model.simulation.layout import FRONT_AXLE, NODAL_DEVIATION, REAR_AXLE, SECONDS_PER_HOUR, STARTED
from agvbench.model.simulation.step import set_motion
from agvbench.types import Floats

# Less of the drive's speed than this is left ahead only if numbers are nonsense.
_LEAST_PART = 0.05
# Below this speed [m/s] the drive's level hardly shows.
_LEVEL_MPS = 0.05


@compiled(inner=True)
def _longitudinal_speed(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, speed: float) -> float:
    """Return how fast the centroid moves ahead at this speed of the drive, as the axles stand."""
    s[TIME] = now
    s[HOURS] = vehicle[STARTED] + now / SECONDS_PER_HOUR
    s[FRONT], s[REAR], s[SPEED] = servos[2], servos[3], speed
    set_motion(s, p, vehicle[FRONT_AXLE], vehicle[REAR_AXLE])
    return float(s[FORWARD])


@compiled(inner=True)
def drive_speed(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, longitudinal: float) -> float:
    """Return the drive's speed with which the centroid moves forward at `longitudinal`."""
    if longitudinal == 0.0:
        return 0.0
    part = _longitudinal_speed(s, p, vehicle, servos, now, longitudinal) / longitudinal
    return longitudinal / part if part > _LEAST_PART else longitudinal


@compiled(inner=True)
def level_lift(
    s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, recent_speed: float, speed: float
) -> float:
    """Return by how much the drive has recently been faster than its commands made it, beyond random deviation."""
    deviation = vehicle[NODAL_DEVIATION]
    if deviation == math.inf:
        return 0.0
    commanded = _longitudinal_speed(s, p, vehicle, servos, now, servos[5])
    factor = (commanded * recent_speed + _LEVEL_MPS**2) / (commanded * commanded + _LEVEL_MPS**2)
    off = math.log(factor) if factor > 0.0 else 0.0
    if off == 0.0:
        return 0.0
    weight = 1.0 / (1.0 + (deviation / off) ** 4)
    return float(weight * (drive_speed(s, p, vehicle, servos, now, speed) - servos[5]))


@compiled(inner=True)
def see_late(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, start: Floats) -> None:
    """Move the start ahead of what a camera reports that smooths: it is behind as in a steady motion."""
    _longitudinal_speed(s, p, vehicle, servos, now, servos[4])
    cosine, sine, lag = math.cos(start[2]), math.sin(start[2]), s[SEEN_LAG]
    start[0] += lag * (cosine * s[FORWARD] - sine * s[LEFT])
    start[1] += lag * (sine * s[FORWARD] + cosine * s[LEFT])
    start[2] += lag * s[YAW_RATE]
