# mypy: warn-return-any=False
"""Servos and drive, compiled: from a latched command to the angles and the wheel speed within one step."""

from __future__ import annotations

import math

from agvbench.compiled import cached_njit
from agvbench.simulator.hidden.constants import (
    ACCELERATE_S,
    BACKLASH,
    BRAKE_S,
    DEAD_WIDTH,
    DRIVE_DAMPING,
    DRIVE_DEAD,
    DRIVE_FREQUENCY,
    DRIVE_SIGN,
    DROOP,
    FADE,
    FADE_HOURS,
    FRONT_HIGH,
    FRONT_LOW,
    FRONT_OFFSET,
    FRONT_SLOPE,
    GAIN_BACKWARD,
    GAIN_FORWARD,
    LAG_S,
    LIMIT_FRONT,
    LIMIT_REAR,
    NEUTRAL,
    RAMP,
    REAR_HIGH,
    REAR_LOW,
    REAR_OFFSET,
    REAR_SLOPE,
    SAG,
    SAG_S,
    SERVO_DAMPING,
    SERVO_FREQUENCY,
    SLEW,
    SLEW_ACCELERATION,
    TURN_DROOP,
)  # fmt: skip
from agvbench.types import Floats

_HOUR_S = 3600.0


@cached_njit()
def clip(value: float, low: float, high: float) -> float:
    """Return `value` within [low, high]."""
    return min(high, max(low, value))


@cached_njit()
def front_aim(p: Floats, command: float) -> float:
    """Return the angle [rad] at which the front servo aims."""
    angle = clip(p[FRONT_OFFSET] + p[FRONT_SLOPE] * (command - p[NEUTRAL]), p[FRONT_LOW], p[FRONT_HIGH])
    return clip(angle, -p[LIMIT_FRONT], p[LIMIT_FRONT])


@cached_njit()
def rear_aim(p: Floats, command: float) -> float:
    """Return the angle [rad] at which the rear servo aims."""
    angle = clip(p[REAR_OFFSET] + p[REAR_SLOPE] * (command - p[NEUTRAL]), p[REAR_LOW], p[REAR_HIGH])
    return clip(angle, -p[LIMIT_REAR], p[LIMIT_REAR])


@cached_njit()
def wheel_aim(p: Floats, command: float) -> float:
    """Return the wheel speed [m/s] of a fresh battery; with a negative sign a falling pulse drives forward."""
    longitudinal = p[DRIVE_SIGN] * (command - p[NEUTRAL])
    beyond = abs(longitudinal) - p[DRIVE_DEAD]
    if beyond <= 0.0 or abs(longitudinal) <= p[DEAD_WIDTH]:
        return 0.0
    return p[GAIN_FORWARD] * beyond if longitudinal > 0.0 else -p[GAIN_BACKWARD] * beyond


@cached_njit()
def supply(p: Floats, session_s: float, driven_s: float) -> float:
    """Return what battery and controller leave of the speed, after hours in the session and seconds of driving."""
    hours = session_s / _HOUR_S
    left = 1.0 - p[DROOP] * hours - p[FADE] * (1.0 - math.exp(-hours / p[FADE_HOURS]))
    return max(0.0, left * (1.0 - p[SAG] * (1.0 - math.exp(-driven_s / p[SAG_S]))))


@cached_njit()
def turn_supply(p: Floats, session_s: float, driven_s: float) -> float:
    """Return what battery and controller leave of a differential vehicle's yaw rate."""
    hours = session_s / _HOUR_S
    left = 1.0 - p[TURN_DROOP] * hours - p[FADE] * (1.0 - math.exp(-hours / p[FADE_HOURS]))
    return max(0.0, left * (1.0 - p[SAG] * (1.0 - math.exp(-driven_s / p[SAG_S]))))


@cached_njit()
def _turning(p: Floats, aim: float, angle: float, rate: float) -> tuple[float, float]:
    """Return the time derivatives of a servo's angle and rate."""
    if p[SERVO_FREQUENCY] > 0.0:
        omega = p[SERVO_FREQUENCY]
        return rate, omega * (omega * (aim - angle) - 2.0 * p[SERVO_DAMPING] * rate)
    return clip((aim - angle) / p[LAG_S], -p[SLEW], p[SLEW]), 0.0


@cached_njit()
def _profiled(p: Floats, aim: float, angle: float, rate: float, dt: float) -> tuple[float, float]:
    """Return angle and rate after `dt` of a servo that may neither turn faster than its slew nor jerk."""
    error = aim - angle
    wanted = math.copysign(min(p[SLEW], math.sqrt(2.0 * p[SLEW_ACCELERATION] * abs(error))), error)
    change = p[SLEW_ACCELERATION] * dt
    later = clip(wanted, rate - change, rate + change)
    turned = 0.5 * (rate + later) * dt
    if abs(turned) >= abs(error) and turned * error >= 0.0:
        return aim, 0.0
    return angle + turned, later


@cached_njit()
def servo(p: Floats, aim: float, angle: float, rate: float, dt: float) -> tuple[float, float]:
    """Return a servo's angle and rate `dt` later: at once, at a limited rate, or by a Runge-Kutta step of its lag."""
    if p[SERVO_FREQUENCY] == 0.0 and p[LAG_S] == 0.0:
        if p[SLEW_ACCELERATION] < math.inf:
            return _profiled(p, aim, angle, rate, dt)
        if p[SLEW] < math.inf:
            return angle + clip(aim - angle, -p[SLEW] * dt, p[SLEW] * dt), 0.0
        return aim, 0.0
    a1, r1 = _turning(p, aim, angle, rate)
    a2, r2 = _turning(p, aim, angle + 0.5 * dt * a1, rate + 0.5 * dt * r1)
    a3, r3 = _turning(p, aim, angle + 0.5 * dt * a2, rate + 0.5 * dt * r2)
    a4, r4 = _turning(p, aim, angle + dt * a3, rate + dt * r3)
    sixth = dt / 6.0
    return angle + sixth * (a1 + 2.0 * (a2 + a3) + a4), rate + sixth * (r1 + 2.0 * (r2 + r3) + r4)


@cached_njit()
def linked(p: Floats, angle: float, before: float) -> float:
    """Return the axle's angle behind backlash that the servo has to close first."""
    return clip(before, angle - 0.5 * p[BACKLASH], angle + 0.5 * p[BACKLASH])


@cached_njit()
def _gaining(p: Floats, aim: float, speed: float) -> float:
    """Return the time derivative of a lagging wheel speed."""
    grows = (aim - speed) * speed > 0.0 or speed == 0.0
    return (aim - speed) / (p[ACCELERATE_S] if grows else p[BRAKE_S])


@cached_njit()
def wheel(p: Floats, aim: float, speed: float, dt: float) -> float:
    """Return the wheel speed `dt` later."""
    if p[RAMP] < math.inf:
        return speed + clip(aim - speed, -p[RAMP] * dt, p[RAMP] * dt)
    if p[ACCELERATE_S] <= 0.0 or p[BRAKE_S] <= 0.0:
        return aim
    k1 = _gaining(p, aim, speed)
    k2 = _gaining(p, aim, speed + 0.5 * dt * k1)
    k3 = _gaining(p, aim, speed + 0.5 * dt * k2)
    k4 = _gaining(p, aim, speed + dt * k3)
    return speed + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


@cached_njit()
def motor(p: Floats, aim: float, speed: float, rate: float, dt: float) -> tuple[float, float]:
    """Return the wheel speed and its rate `dt` later: of second order if the drive has a frequency."""
    omega, damping = p[DRIVE_FREQUENCY], p[DRIVE_DAMPING]
    if omega == 0.0:
        return wheel(p, aim, speed, dt), 0.0
    h = 0.5 * dt
    a1 = omega * (omega * (aim - speed) - 2.0 * damping * rate)
    r2, a2 = rate + h * a1, omega * (omega * (aim - speed - h * rate) - 2.0 * damping * (rate + h * a1))
    r3, a3 = rate + h * a2, omega * (omega * (aim - speed - h * r2) - 2.0 * damping * (rate + h * a2))
    r4, a4 = rate + dt * a3, omega * (omega * (aim - speed - dt * r3) - 2.0 * damping * (rate + dt * a3))
    sixth = dt / 6.0
    return speed + sixth * (rate + 2.0 * (r2 + r3) + r4), rate + sixth * (a1 + 2.0 * (a2 + a3) + a4)
