# mypy: warn-return-any=False
"""The integrator of hidden plants, compiled: classical Runge-Kutta on a grid that restarts with every command.

Steps end at grid points and whenever a command takes effect. A call that ends inside a step returns a partial step
from its start and throws it away: how the time is split changes a result by rounding only.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.simulator.hidden import _actuators as actuators
from agvbench.simulator.hidden import _body as body
from agvbench.simulator.hidden import _differential as differential
from agvbench.simulator.hidden.constants import (
    CASTER_KICK,
    COMMAND_HIGH,
    COMMAND_LOW,
    DELAY_S,
    DIFFERENTIAL,
    DRIVE_DELAY_SHARE,
    LATENCY_S,
    LENS,
    MARKER_FORWARD,
    MARKER_LEFT,
    NEUTRAL,
    SCALE,
    SCRUB,
    SCRUB_INTEGRAL_S,
    SEAM_DIRECTION,
    SEAM_KICK,
    SEAM_PLACE,
    SHORTFALL,
    SMOOTHING_S,
    STICK_S,
    STICK_TWIST,
    TURNED,
)  # fmt: skip
from agvbench.types import Floats

_ROUNDS = 60


@cached_njit()
def seen(p: Floats, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Return the pose that the camera reports for a true pose of where the markers should be."""
    c, s = math.cos(heading), math.sin(heading)
    mx = x + (c * p[MARKER_FORWARD] - s * p[MARKER_LEFT])
    my = y + (s * p[MARKER_FORWARD] + c * p[MARKER_LEFT])
    bent = (1.0 + p[SCALE]) * (1.0 + p[LENS] * (mx * mx + my * my))
    return bent * mx, bent * my, heading + p[TURNED]


@cached_njit()
def unseen(p: Floats, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Return the true pose at which the camera reports the given one: a vehicle is placed by what is seen of it."""
    true_heading = heading - p[TURNED]
    mx, my = x / (1.0 + p[SCALE]), y / (1.0 + p[SCALE])
    px, py = mx, my
    for _ in range(_ROUNDS):
        bend = 1.0 + p[LENS] * (px * px + py * py)
        px, py = mx / bend, my / bend
    c, s = math.cos(true_heading), math.sin(true_heading)
    left_x = c * p[MARKER_FORWARD] - s * p[MARKER_LEFT]
    left_y = s * p[MARKER_FORWARD] + c * p[MARKER_LEFT]
    return px - left_x, py - left_y, true_heading


STEP_S = 1.0 / 600.0
_ROUNDING_S = 1e-10

# The state of a run; SESSION goes on from run to run, and so does ROLLED.
(
    X, Y, HEADING, ROLLED, CLOCK, GRID, SESSION,
    DRIVE, FRONT, REAR, AIM_WHEEL, AIM_FRONT, AIM_REAR,
    SERVO_FRONT, RATE_FRONT, SERVO_REAR, RATE_REAR, AXLE_FRONT, AXLE_REAR, WHEEL,
    STARTED, MOVING, SMOOTH_X, SMOOTH_Y, SMOOTH_HEADING, COMMANDED_DRIVE, COMMANDED_FRONT, COMMANDED_REAR,
    RATE_WHEEL, CASTER, EFFORT,
) = range(31)  # fmt: skip
STATE_SIZE = 31
VARIATION_FRONT, VARIATION_REAR, VARIATION_SPEED = range(3)

# Commands on their way: a ring of (when, which, value), which = 0 drive, 1 front, 2 rear.
RING = 256
# Poses passed: a ring of (when, x, y, heading).
PAST = 2048


@cached_njit()
def begin(p: Floats, state: Floats, past: Floats, marks: np.ndarray, pose: tuple[float, float, float]) -> None:
    """Put the vehicle at rest where the camera sees it at `pose`."""
    session, rolled = state[SESSION], state[ROLLED]
    state[:] = 0.0
    state[SESSION], state[ROLLED] = session, rolled
    state[X], state[Y], state[HEADING] = unseen(p, pose[0], pose[1], pose[2])
    state[SMOOTH_X], state[SMOOTH_Y], state[SMOOTH_HEADING] = pose
    state[DRIVE] = state[FRONT] = state[REAR] = p[NEUTRAL]
    state[COMMANDED_DRIVE] = state[COMMANDED_FRONT] = state[COMMANDED_REAR] = p[NEUTRAL]
    state[AIM_FRONT] = state[SERVO_FRONT] = state[AXLE_FRONT] = actuators.front_aim(p, p[NEUTRAL])
    state[AIM_REAR] = state[SERVO_REAR] = state[AXLE_REAR] = actuators.rear_aim(p, p[NEUTRAL])
    state[GRID] = STEP_S
    state[CASTER] = differential.CASTER_BEGINS_RAD
    marks[:] = 0
    past[0, 0], past[0, 1], past[0, 2], past[0, 3] = 0.0, state[X], state[Y], state[HEADING]
    marks[2] = 1


@cached_njit()
def _command(p: Floats, state: Floats, ring: Floats, marks: np.ndarray, which: int, value: float) -> None:
    """Send a changed command on its way."""
    value = actuators.clip(value, p[COMMAND_LOW], p[COMMAND_HIGH])
    if value == state[COMMANDED_DRIVE + which]:
        return
    state[COMMANDED_DRIVE + which] = value
    share = p[DRIVE_DELAY_SHARE] if which == 0 else 1.0
    at = marks[1] % RING
    ring[at, 0], ring[at, 1], ring[at, 2] = state[CLOCK] + share * p[DELAY_S], which, value
    marks[1] += 1


@cached_njit()
def _latch(p: Floats, state: Floats, which: int, value: float) -> None:
    """Let a command that has arrived take effect."""
    state[DRIVE + which] = value
    if which == 0:
        state[AIM_WHEEL] = actuators.wheel_aim(p, value)
        return
    aim = actuators.front_aim(p, value) if which == 1 else actuators.rear_aim(p, value)
    state[AIM_WHEEL + which] = aim - p[SHORTFALL] * (aim - state[AIM_WHEEL + which])


@cached_njit()
def _next_arrival(ring: Floats, marks: np.ndarray) -> int:
    """Return where in the ring the earliest command on its way lies, or -1; taken ones are marked by -1."""
    best, when = -1, math.inf
    while marks[0] < marks[1] and ring[marks[0] % RING, 1] < 0.0:
        marks[0] += 1
    for i in range(marks[0], marks[1]):
        if ring[i % RING, 1] >= 0.0 and ring[i % RING, 0] < when:
            best, when = i % RING, ring[i % RING, 0]
    return best


@cached_njit()
def _rates(
    p: Floats, state: Floats, run_variation: Floats, at: tuple[float, float, float, float], front: float, rear: float,
    speed: float, t: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return the derivatives of x, y, heading and rolled distance at `at`, `t` seconds into the step."""
    since = state[CLOCK] + t - state[STARTED]
    if since < p[STICK_S] and abs(speed) > body.MOVES_MPS:
        return 0.0, 0.0, math.copysign(p[STICK_TWIST] / p[STICK_S], speed), abs(speed)
    if p[DIFFERENTIAL] != 0.0:
        uneven = (run_variation[VARIATION_FRONT], run_variation[VARIATION_REAR])
        return differential.motion(p, at, front, speed, uneven, state[CASTER], state[SESSION])
    front, rear = body.wheels(
        p, front + run_variation[VARIATION_FRONT], rear + run_variation[VARIATION_REAR], speed, state[SESSION]
    )
    return body.motion(p, at[0], at[1], at[2], at[3], front, rear, speed)


@cached_njit()
def _step(p: Floats, state: Floats, run_variation: Floats, dt: float, out: Floats) -> None:
    """Write the state `dt` later into `out`."""
    out[:] = state
    h = 0.5 * dt
    driven = state[CLOCK] - state[STARTED] if state[MOVING] > 0.0 else 0.0
    aim = state[AIM_WHEEL] * actuators.supply(p, state[SESSION], driven) * (1.0 + run_variation[VARIATION_SPEED])
    w0, _ = actuators.motor(p, aim, state[WHEEL], state[RATE_WHEEL], 0.0)
    w1, rw1 = actuators.motor(p, aim, state[WHEEL], state[RATE_WHEEL], h)
    w2, rw2 = actuators.motor(p, aim, w1, rw1, h)
    front = state[AIM_FRONT]
    if p[DIFFERENTIAL] != 0.0:
        front *= actuators.turn_supply(p, state[SESSION], driven)
    f0, _ = actuators.servo(p, front, state[SERVO_FRONT], state[RATE_FRONT], 0.0)
    f1, rf1 = actuators.servo(p, front, state[SERVO_FRONT], state[RATE_FRONT], h)
    f2, rf2 = actuators.servo(p, front, f1, rf1, h)
    r0, _ = actuators.servo(p, state[AIM_REAR], state[SERVO_REAR], state[RATE_REAR], 0.0)
    r1, rr1 = actuators.servo(p, state[AIM_REAR], state[SERVO_REAR], state[RATE_REAR], h)
    r2, rr2 = actuators.servo(p, state[AIM_REAR], r1, rr1, h)
    a0 = actuators.linked(p, f0, state[AXLE_FRONT])
    a1 = actuators.linked(p, f1, a0)
    a2 = actuators.linked(p, f2, a1)
    out[AXLE_FRONT] = a2
    if p[SCRUB] != 0.0:
        wanted, effort = (a0, a1, a2), state[EFFORT]
        a0 = differential.scrubbed(p, a0, effort)
        a1 = differential.scrubbed(p, a1, effort + h * (wanted[0] - a0) / p[SCRUB_INTEGRAL_S])
        out[EFFORT] = effort + dt * (wanted[1] - a1) / p[SCRUB_INTEGRAL_S]
        a2 = differential.scrubbed(p, a2, out[EFFORT])
    b0 = actuators.linked(p, r0, state[AXLE_REAR])
    b1 = actuators.linked(p, r1, b0)
    b2 = actuators.linked(p, r2, b1)
    x, y, z, d = state[X], state[Y], state[HEADING], state[ROLLED]
    k1 = _rates(p, state, run_variation, (x, y, z, d), a0, b0, w0, 0.0)
    k2 = _rates(p, state, run_variation, (x + h * k1[0], y + h * k1[1], z + h * k1[2], d + h * k1[3]), a1, b1, w1, h)
    k3 = _rates(p, state, run_variation, (x + h * k2[0], y + h * k2[1], z + h * k2[2], d + h * k2[3]), a1, b1, w1, h)
    k4 = _rates(
        p, state, run_variation, (x + dt * k3[0], y + dt * k3[1], z + dt * k3[2], d + dt * k3[3]), a2, b2, w2, dt
    )
    for i in range(4):
        out[X + i] = state[X + i] + dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    out[SERVO_FRONT], out[RATE_FRONT], out[SERVO_REAR], out[RATE_REAR] = f2, rf2, r2, rr2
    out[AXLE_REAR], out[WHEEL] = b2, w2
    out[RATE_WHEEL] = rw2
    if p[CASTER_KICK] != 0.0:
        out[CASTER] = state[CASTER] + dt * differential.caster_rate(p, state[CASTER], w1, a1)
    out[CLOCK], out[SESSION] = state[CLOCK] + dt, state[SESSION] + dt
    _cross_seam(p, state, out)


@cached_njit()
def _cross_seam(p: Floats, state: Floats, out: Floats) -> None:
    """Turn a vehicle that has crossed the seam: one way when it crosses one way, the other way when it comes back."""
    if p[SEAM_KICK] == 0.0:
        return
    c, s = math.cos(p[SEAM_DIRECTION]), math.sin(p[SEAM_DIRECTION])
    before = c * state[X] + s * state[Y] - p[SEAM_PLACE]
    after = c * out[X] + s * out[Y] - p[SEAM_PLACE]
    if before < 0.0 <= after:
        out[HEADING] += p[SEAM_KICK]
    elif after < 0.0 <= before:
        out[HEADING] -= p[SEAM_KICK]


@cached_njit()
def _notice_start(p: Floats, state: Floats) -> None:
    """Note when the vehicle was last commanded to move from rest."""
    moving = abs(state[AIM_WHEEL]) > 0.0 or (p[DIFFERENTIAL] != 0.0 and abs(state[AIM_FRONT]) > 0.0)
    if moving and state[MOVING] == 0.0:
        state[STARTED] = state[CLOCK]
    state[MOVING] = 1.0 if moving else 0.0


@cached_njit()
def _commit(p: Floats, state: Floats, work: Floats, past: Floats, marks: np.ndarray) -> None:
    """Make a step's end the state, and remember the pose."""
    dt = work[CLOCK] - state[CLOCK]
    if p[SMOOTHING_S] > 0.0:
        _smooth(p, work, dt)
    state[:] = work
    at = marks[2] % PAST
    past[at, 0], past[at, 1], past[at, 2], past[at, 3] = state[CLOCK], state[X], state[Y], state[HEADING]
    marks[2] += 1


@cached_njit()
def _smooth(p: Floats, work: Floats, dt: float) -> None:
    x, y, heading = seen(p, work[X], work[Y], work[HEADING])
    share = -math.expm1(-dt / p[SMOOTHING_S])
    work[SMOOTH_X] += share * (x - work[SMOOTH_X])
    work[SMOOTH_Y] += share * (y - work[SMOOTH_Y])
    work[SMOOTH_HEADING] += share * (heading - work[SMOOTH_HEADING])


@cached_njit()
def _look(p: Floats, work: Floats, past: Floats, marks: np.ndarray, dt: float) -> tuple[float, float, float]:
    """Return what the camera says at the time of `work`, `dt` after the last committed state."""
    if p[SMOOTHING_S] > 0.0:
        _smooth(p, work, dt)
        return work[SMOOTH_X], work[SMOOTH_Y], work[SMOOTH_HEADING]
    if p[LATENCY_S] == 0.0:
        return seen(p, work[X], work[Y], work[HEADING])
    when = work[CLOCK] - p[LATENCY_S]
    t1, x1, y1, z1 = work[CLOCK], work[X], work[Y], work[HEADING]
    oldest = max(0, marks[2] - PAST)
    for i in range(marks[2] - 1, oldest - 1, -1):
        t0, x0, y0, z0 = past[i % PAST, 0], past[i % PAST, 1], past[i % PAST, 2], past[i % PAST, 3]
        if t0 <= when:
            share = (when - t0) / (t1 - t0) if t1 > t0 else 0.0
            return seen(p, x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0))
        t1, x1, y1, z1 = t0, x0, y0, z0
    return seen(p, x1, y1, z1)


@cached_njit()
def advance(
    p: Floats, run_variation: Floats, state: Floats, ring: Floats, past: Floats, marks: np.ndarray, work: Floats,
    drive: float, front: float, rear: float, dt: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Hold the command for `dt` seconds; return the pose that the camera sees then.

    `marks` holds how many commands have been taken and sent, how many poses passed, and nothing else; the part of a
    step that is under way is kept in ``work[1, 0]``.
    """
    target = work[1, 0] + dt  # time since the last committed state
    commanded = (drive, front, rear)
    changed = False
    for which in range(3):
        value = actuators.clip(commanded[which], p[COMMAND_LOW], p[COMMAND_HIGH])
        changed = changed or value != state[COMMANDED_DRIVE + which]
    if changed:
        if work[1, 0] > _ROUNDING_S:
            _step(p, state, run_variation, work[1, 0], work[0])
            _commit(p, state, work[0], past, marks)
        work[1, 0], target = 0.0, dt
        state[GRID] = state[CLOCK] + STEP_S
        for which in range(3):
            _command(p, state, ring, marks, which, commanded[which])
    while True:
        arrival = _next_arrival(ring, marks)
        if arrival >= 0 and ring[arrival, 0] <= state[CLOCK] + _ROUNDING_S:
            _latch(p, state, int(ring[arrival, 1]), ring[arrival, 2])
            ring[arrival, 1] = -1.0
            _notice_start(p, state)
            continue
        end = state[GRID] - state[CLOCK]
        if arrival >= 0:
            end = min(end, ring[arrival, 0] - state[CLOCK])
        if end > target + _ROUNDING_S:
            break
        _step(p, state, run_variation, end, work[0])
        _commit(p, state, work[0], past, marks)
        if state[CLOCK] >= state[GRID] - _ROUNDING_S:
            state[GRID] += STEP_S
        target -= end
    target = max(0.0, target)
    work[1, 0] = target
    _step(p, state, run_variation, target, work[0])
    return _look(p, work[0], past, marks, target)
