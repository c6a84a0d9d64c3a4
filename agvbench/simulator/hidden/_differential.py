# mypy: warn-return-any=False
"""Wheels, body and floor of a differential vehicle, compiled: from wheel speeds to the motion of the markers.

The two wheels have speeds of their own. What they roll moves the middle of the axle and turns the body; the markers'
centroid lies ahead of it.
"""

from __future__ import annotations

import math

from agvbench.compiled import cached_njit
from agvbench.simulator.hidden._body import grip, over_floor, slipping, warmth
from agvbench.simulator.hidden.constants import (
    CASTER_KICK,
    CASTER_TRAIL,
    COURSE_CURVATURE,
    REAR_AXLE,
    RUNOUT,
    RUNOUT_PERIOD,
    RUNOUT_PHASE,
    SCRUB,
    TRACK,
    WHEEL_CURVATURE,
)
from agvbench.types import Floats

CASTER_AHEAD_M = 0.12
"""From the axle to the caster."""
CASTER_BEGINS_RAD = 0.3
"""The angle at which a vehicle that was set down has its caster: nearly as if it had come forward."""


@cached_njit()
def caster_rate(p: Floats, caster: float, speed: float, yaw_rate: float) -> float:
    """Return how fast the caster swivels [rad/s]: its wheel trails behind the pivot."""
    along, across = speed, CASTER_AHEAD_M * yaw_rate
    return (math.cos(caster) * across - math.sin(caster) * along) / p[CASTER_TRAIL]


@cached_njit()
def scrubbed(p: Floats, wanted: float, effort: float) -> float:
    """Return the yaw rate [rad/s] that dry friction leaves of what is wanted and of the controller's `effort`."""
    torque = wanted + effort
    return torque - min(max(torque, -p[SCRUB]), p[SCRUB])


@cached_njit()
def motion(
    p: Floats, at: tuple[float, float, float, float], yaw_rate: float, speed: float, uneven: tuple[float, float],
    caster: float, session_s: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return the time derivatives of x, y, heading and of the distance that the left wheel has rolled.

    `uneven` holds by what share each wheel, left and right, is faster in this run.
    """
    x, y, heading, rolled = at
    half = 0.5 * p[TRACK] * warmth(p, session_s) * yaw_rate
    left_of_speed = grip(p, x, y, heading, 0.0, 0.0)
    eccentric = p[RUNOUT] * math.sin(2.0 * math.pi * rolled / p[RUNOUT_PERIOD] + p[RUNOUT_PHASE])
    left = (speed - half) * left_of_speed * (1.0 + uneven[0]) * (1.0 + eccentric)
    right = (speed + half) * left_of_speed * (1.0 + uneven[1])
    forward, turn = 0.5 * (left + right), (right - left) / p[TRACK]
    fast = abs(forward)
    turn = slipping(p, turn, fast)
    turn += p[WHEEL_CURVATURE] * forward + p[COURSE_CURVATURE] * fast
    turn += p[CASTER_KICK] / math.pi * caster_rate(p, caster, forward, turn) if p[CASTER_KICK] != 0.0 else 0.0
    lateral = p[REAR_AXLE] * turn
    x_rate, y_rate = over_floor(p, heading, forward, lateral, math.hypot(forward, lateral))
    return x_rate, y_rate, turn, abs(left)
