"""The speeds of drive and body in proportion: limits of the body's acceleration, and simulations that begin in motion.

A simulation in motion begins with a measured speed and yaw rate, and with the drive level that they indicate.

A part of the kernel; see `agvbench.model.simulation.compose`.
"""

from __future__ import annotations

import math

from agvbench.effects.state import (
    ACCELERATION_LIMIT,
    BODY_ACCELERATION_LIMIT,
    BODY_BRAKING_LIMIT,
    BRAKING_LIMIT,
    FORWARD,
    FRONT,
    FRONT_AIM,
    HOURS,
    LEFT,
    REAR,
    REAR_AIM,
    SEEN_LAG,
    SPEED,
    SPEED_AIM,
    TIME,
    YAW_RATE,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation.layout import NODAL_DEVIATION, SECONDS_PER_HOUR, STARTED
from agvbench.model.simulation.step import set_motion
from agvbench.types import Floats

# Least ratio of longitudinal speed to drive speed; less occurs with invalid parameters only.
_LEAST_PART = 0.05
# Secants towards a yaw rate, and their width [rad]; least yaw rate per front angle [1/s]; largest correction [rad].
_SECANTS, _SECANT_RAD, _LEAST_SLOPE, _MOST_RAD = 3, 1e-3, 0.1, 0.5
# Below this speed [m/s] the drive level is not significant.
_LEVEL_MPS = 0.05


@compiled(inner=True)
def _longitudinal_speed_at(
    s: Floats, p: Floats, vehicle: Floats, front: float, rear: float, now: float, speed: float
) -> float:
    """Return the longitudinal speed of the centroid at this speed of the drive, with these axle angles."""
    s[TIME] = now
    s[HOURS] = vehicle[STARTED] + now / SECONDS_PER_HOUR
    s[FRONT], s[REAR], s[SPEED] = front, rear, speed
    set_motion(s, p, vehicle)
    return float(s[FORWARD])


@compiled(inner=True)
def _longitudinal_speed(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, speed: float) -> float:
    """Return the longitudinal speed of the centroid at this speed of the drive, with the current axle angles."""
    return _longitudinal_speed_at(s, p, vehicle, servos[2], servos[3], now, speed)


@compiled(inner=True)
def limit_body(s: Floats, p: Floats, vehicle: Floats, now: float) -> None:
    """Limit the drive so that the body, which steered axles drive slower than themselves, keeps within its own limits.

    The ratio of both speeds is that of the command's steady state.
    """
    if s[SPEED_AIM] == 0.0 or (s[BODY_ACCELERATION_LIMIT] == math.inf and s[BODY_BRAKING_LIMIT] == math.inf):
        return
    part = _longitudinal_speed_at(s, p, vehicle, s[FRONT_AIM], s[REAR_AIM], now, s[SPEED_AIM]) / s[SPEED_AIM]
    part = part if part > _LEAST_PART else 1.0
    s[ACCELERATION_LIMIT] = min(s[ACCELERATION_LIMIT], s[BODY_ACCELERATION_LIMIT] / part)
    s[BRAKING_LIMIT] = min(s[BRAKING_LIMIT], s[BODY_BRAKING_LIMIT] / part)


@compiled(inner=True)
def drive_speed(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, longitudinal: float) -> float:
    """Return the speed of the drive at which the centroid has the speed `longitudinal`."""
    if longitudinal == 0.0:
        return 0.0
    part = _longitudinal_speed(s, p, vehicle, servos, now, longitudinal) / longitudinal
    return longitudinal / part if part > _LEAST_PART else longitudinal


@compiled(inner=True)
def front_correction(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, yaw_rate: float) -> float:
    """Return the change of the front angle (of a differential vehicle: yaw rate) with which it turns at `yaw_rate`.

    It is found by secants. Where the front angle hardly turns the vehicle, it is not changed.
    """
    before = servos[2]
    change = 0.0
    for _ in range(_SECANTS):
        servos[2] = before + change
        _longitudinal_speed(s, p, vehicle, servos, now, servos[4])
        missing = yaw_rate - s[YAW_RATE]
        servos[2] = before + change + _SECANT_RAD
        _longitudinal_speed(s, p, vehicle, servos, now, servos[4])
        slope = (s[YAW_RATE] - (yaw_rate - missing)) / _SECANT_RAD
        if abs(slope) < _LEAST_SLOPE:
            break
        change = min(max(change + missing / slope, -_MOST_RAD), _MOST_RAD)
    servos[2] = before
    return change


@compiled(inner=True)
def level_lift(
    s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, recent_speed: float, speed: float
) -> float:
    """Return by how much the drive is faster than commanded, weighted by its significance.

    The means of a speed that changed recently do not tell the level: their ratio counts the less, the larger the
    variance of the commanded speed was.
    """
    deviation = vehicle[NODAL_DEVIATION]
    if deviation == math.inf:
        return 0.0
    commanded = _longitudinal_speed(s, p, vehicle, servos, now, servos[5])
    uncertain = _LEVEL_MPS**2 + max(servos[9] - servos[5] * servos[5], 0.0)
    factor = (commanded * recent_speed + uncertain) / (commanded * commanded + uncertain)
    log_ratio = math.log(factor) if factor > 0.0 else 0.0
    if log_ratio == 0.0:
        return 0.0
    weight = 1.0 / (1.0 + (deviation / log_ratio) ** 4)
    faster = drive_speed(s, p, vehicle, servos, now, speed) - servos[5]
    return float(weight * faster * math.copysign(1.0, servos[5]))


@compiled(inner=True)
def _displace(s: Floats, duration: float, start: Floats) -> None:
    """Displace the start by the body's velocity over a `duration`."""
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    start[0] += duration * (cosine * s[FORWARD] - sine * s[LEFT])
    start[1] += duration * (sine * s[FORWARD] + cosine * s[LEFT])


@compiled(inner=True)
def move_ahead(
    s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, distance: float, start: Floats
) -> None:
    """Move the start ahead by a `distance` of the drive."""
    _longitudinal_speed(s, p, vehicle, servos, now, 1.0)
    _displace(s, distance, start)


@compiled(inner=True)
def see_late(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, start: Floats) -> None:
    """Move the start ahead of the pose that a smoothing camera reports, by its delay in steady motion."""
    _longitudinal_speed(s, p, vehicle, servos, now, servos[4])
    _displace(s, s[SEEN_LAG], start)
    start[2] += s[SEEN_LAG] * s[YAW_RATE]
