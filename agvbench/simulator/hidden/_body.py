# mypy: warn-return-any=False
"""Wheels, body and floor, compiled: from axle angles and wheel speed to the motion of the vehicle."""

from __future__ import annotations

import math

from agvbench.compiled import cached_njit
from agvbench.simulator.hidden.constants import (
    AXLE_RATIO,
    DRIFT,
    DRIFT_DIRECTION,
    DRIFT_SHARE,
    FRONT_AXLE,
    FRONT_FROM_REAR,
    FRONT_TRIM,
    LONGER,
    LOSS_SQUARE,
    LOSS_TANGENT,
    NAP,
    NAP_DIRECTION,
    OVERRUN,
    PATCH_LOSS,
    PATCH_RADIUS,
    PATCH_X,
    PATCH_Y,
    REAR_AXLE,
    REAR_FROM_FRONT,
    REVERSE_GAIN,
    RUNOUT,
    RUNOUT_PERIOD,
    RUNOUT_PHASE,
    RUNOUT_TRACK,
    SHARED_BY_DIFFERENTIAL,
    SLIP_LINEAR,
    SLIP_SQUARE,
    TORQUE_STEER,
    WARM_GAIN,
    WARM_HOURS,
    WHEEL_CURVATURE,
)  # fmt: skip
from agvbench.types import Floats

MOVES_MPS = 0.002
"""A vehicle slower than this stands, as far as the floor is concerned."""
_HOUR_S = 3600.0


@cached_njit()
def warmth(p: Floats, session_s: float) -> float:
    """Return by what factor the steering, or the tyres' grip in turns, has changed since the session began."""
    return 1.0 + p[WARM_GAIN] * (1.0 - math.exp(-session_s / (_HOUR_S * p[WARM_HOURS])))


@cached_njit()
def slipping(p: Floats, yaw_rate: float, speed: float) -> float:
    """Return the yaw rate that slip leaves at a `speed` (its magnitude)."""
    return yaw_rate / (1.0 + p[SLIP_SQUARE] * speed * speed + p[SLIP_LINEAR] * speed)


@cached_njit()
def over_floor(p: Floats, heading: float, forward: float, lateral: float, speed: float) -> tuple[float, float]:
    """Return the time derivatives of x and y of a body that the floor lets drift; `speed` is its magnitude."""
    drift = p[DRIFT_SHARE] * speed + (p[DRIFT] if speed > MOVES_MPS else 0.0)
    c, s = math.cos(heading), math.sin(heading)
    return (
        c * forward - s * lateral + drift * math.cos(p[DRIFT_DIRECTION]),
        s * forward + c * lateral + drift * math.sin(p[DRIFT_DIRECTION]),
    )


@cached_njit()
def wheels(p: Floats, front: float, rear: float, speed: float, session_s: float) -> tuple[float, float]:
    """Return the wheels' angles [rad] for the axles' angles: what the linkage makes of them."""
    warm = warmth(p, session_s)
    front, rear = warm * front + p[FRONT_TRIM], warm * rear
    front, rear = front + p[FRONT_FROM_REAR] * rear, rear + p[REAR_FROM_FRONT] * front
    if speed < 0.0:
        return (1.0 + p[REVERSE_GAIN]) * front - p[TORQUE_STEER], (1.0 + p[REVERSE_GAIN]) * rear
    return front + p[TORQUE_STEER], rear


@cached_njit()
def grip(p: Floats, x: float, y: float, heading: float, front: float, rear: float) -> float:
    """Return the share of the wheel speed that place, heading and steering leave."""
    left = 1.0 - p[LOSS_TANGENT] * (abs(math.tan(front)) + abs(math.tan(rear)))
    left -= p[LOSS_SQUARE] * (front * front + rear * rear)
    left *= 1.0 + p[NAP] * math.cos(heading - p[NAP_DIRECTION])
    if (x - p[PATCH_X]) ** 2 + (y - p[PATCH_Y]) ** 2 < p[PATCH_RADIUS] ** 2:
        left *= 1.0 - p[PATCH_LOSS]
    return left


@cached_njit()
def _shared(p: Floats, front: float, rear: float) -> float:
    """Return the body's share of the wheel speed for both axles' shares: their mean, or nearer to the slower one.

    Axles that share a differential have one mean of their wheels' speeds: the body has the harmonic mean.
    """
    stiff = 1.0 + p[OVERRUN]
    heavier, lighter = (front, rear) if front < rear else (rear, front)
    share = p[SHARED_BY_DIFFERENTIAL]
    return (1.0 - share) * (stiff * heavier + lighter) / (stiff + 1.0) + share * 2.0 / (1.0 / front + 1.0 / rear)


@cached_njit()
def motion(
    p: Floats, x: float, y: float, heading: float, rolled: float, front: float, rear: float, speed: float
) -> tuple[float, float, float, float]:
    """Return the time derivatives of x, y, heading and of the distance that the wheels have rolled.

    No axle moves laterally: ``V + lf r = U tan δf`` and ``V − lr r = U tan δr`` with U ahead, V to the left, r the yaw
    rate; U is the mean of what both axles' wheels give along the body.
    """
    longer = 0.5 * p[LONGER] * (p[FRONT_AXLE] + p[REAR_AXLE])
    lf, lr = p[FRONT_AXLE] + longer, p[REAR_AXLE] + longer
    tan_front, tan_rear = math.tan(front), math.tan(rear)
    left_of_speed = grip(p, x, y, heading, front, rear)
    longitudinal = speed * left_of_speed * _shared(p, math.cos(front), (1.0 + p[AXLE_RATIO]) * math.cos(rear))
    lateral = longitudinal * (lr * tan_front + lf * tan_rear) / (lf + lr)
    path_speed = math.copysign(math.hypot(longitudinal, lateral), longitudinal)
    fast = abs(path_speed)
    turn = longitudinal * (tan_front - tan_rear) / (lf + lr)
    turn = slipping(p, turn, fast) + p[WHEEL_CURVATURE] * path_speed
    uneven = p[RUNOUT] * math.sin(2.0 * math.pi * rolled / p[RUNOUT_PERIOD] + p[RUNOUT_PHASE])
    turn -= uneven / p[RUNOUT_TRACK] * longitudinal
    longitudinal += 0.5 * uneven * longitudinal
    x_rate, y_rate = over_floor(p, heading, longitudinal, lateral, fast)
    return x_rate, y_rate, turn, abs(speed)
