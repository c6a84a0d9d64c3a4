"""The general simulation's loop over runs, commands and steps, from command to measured pose.

Steps end where a command takes effect and where the actuators' way has a kink, so that nothing in a step jumps. In a
step the motion is taken at the four Gauss–Legendre nodes; heading and position follow by collocation (Hairer,
Nørsett and Wanner 1993, section II.7), and frames are read off its polynomial.

The stages imported here do nothing. The simulation runs this file's text with the effects' hooks in their place; see
`agvbench.model.simulation_compose`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.effects.state import (
    ACCELERATE_LAG,
    ACCELERATION_LIMIT,
    BRAKE_LAG,
    BRAKING_LIMIT,
    COS_FRONT,
    COS_REAR,
    DISTANCE,
    DRIVE_COMMAND,
    DRIVE_WAIT,
    FORWARD,
    FRONT,
    FRONT_AIM,
    FRONT_BEFORE,
    FRONT_COMMAND,
    FRONT_SPEED,
    HEADING,
    HOURS,
    KNOWN_FRONT,
    KNOWN_REAR,
    LEFT,
    PLAY,
    REAR,
    REAR_AIM,
    REAR_BEFORE,
    REAR_COMMAND,
    REAR_SPEED,
    REAR_WAIT,
    SEEN_HEADING,
    SEEN_LAG,
    SEEN_X,
    SEEN_Y,
    SIZE,
    SPEED,
    SPEED_AIM,
    STEERING_ACCELERATION,
    STEERING_INERTIA,
    STEERING_LAG,
    STEERING_RATE,
    TAN_FRONT,
    TAN_REAR,
    TIME,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation_actuators import (
    PLAN_SIZE,
    SERVOS_SIZE,
    actuate,
    leave_command,
    plan_command,
    step_length,
)
from agvbench.model.simulation_smoothing import SMOOTH_SIZE, bend, smoothed
from agvbench.model.simulation_stages import aim, arrive, capture, drift, drive, move, see, steer
from agvbench.types import Floats

Integers = NDArray[np.int64]

# Gauss–Legendre nodes on [0, 1]; ∫₀^c of the polynomial through values at the nodes is the values times
# c (BASIS[j, 0] + c BASIS[j, 1] + …).
_COUNT = 4
_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(_COUNT)[0]
_BASIS = np.linalg.inv(np.vander(_NODES, _COUNT, increasing=True)).T / np.arange(1.0, _COUNT + 1.0)
_TO_NODES = np.stack([c * (_BASIS @ c ** np.arange(_COUNT)) for c in _NODES])
_WEIGHTS = _BASIS.sum(axis=1)

# Work of one step: at the nodes, motion forward, left and turning, then velocity along x, y and turning.
_AHEAD, _ASIDE, _TURN, _ALONG_X, _ALONG_Y, _TURNED = range(0, 6 * _COUNT, _COUNT)
_SMOOTH = 6 * _COUNT
_WORK_SIZE = _SMOOTH + SMOOTH_SIZE
# Where a step starts: pose, distance driven, and the pose that a smoothing camera reports.
_START_SIZE = 7
_SECONDS_PER_HOUR = 3600.0

# Numbers of the vehicle: axles, longest step, when the run began in hours, and the scatter of the drive's level.
_FRONT_AXLE, _REAR_AXLE, _STEP, _STARTED, _LEVEL_SCATTER = range(5)
# The first step of a command, whose turn is not known yet [s]; how far a later one may turn [rad, and s at most 1].
_FIRST_STEP_S, _TURN_PER_STEP = 0.05, 0.15
# No vehicle turns faster [rad/s]: numbers that say so are nonsense, but must not hang the loop.
_FASTEST_TURN = 150.0
_TOGETHER = 1e-12
# Less of the drive's speed than this is left ahead only if numbers are nonsense.
_LEAST_PART = 0.05
# Below this speed [m/s] the drive's level hardly shows.
_LEVEL_MPS = 0.05
# Lately: averaged with weights that fall with this time constant [s].
LATELY_S = 0.5
_STATE = 4


@compiled(inner=True)
def _start(s: Floats, p: Floats, initial: Floats, run: int) -> None:
    """Put the true pose into `s` that the camera reports as `initial`: what it changes is small, so fixed point."""
    s[X], s[Y], s[HEADING] = initial[run, 0], initial[run, 1], initial[run, 2]
    for _ in range(60):
        _look(s, p)
        x, y, heading = initial[run, 0] - s[SEEN_X], initial[run, 1] - s[SEEN_Y], initial[run, 2] - s[SEEN_HEADING]
        s[X] += x
        s[Y] += y
        s[HEADING] += heading
        if abs(x) + abs(y) + abs(heading) < 1e-14:
            break


@compiled(inner=True)
def _look(s: Floats, p: Floats) -> None:
    s[SEEN_X], s[SEEN_Y], s[SEEN_HEADING] = s[X], s[Y], s[HEADING]
    see(s, p)


@compiled(inner=True)
def _report(s: Floats, p: Floats, out: Floats, k: int) -> None:
    _look(s, p)
    out[k, 0], out[k, 1], out[k, 2] = s[SEEN_X], s[SEEN_Y], s[SEEN_HEADING]


@compiled(inner=True)
def _obey(
    s: Floats, p: Floats, commands: Floats, settled: Floats, driven: int, front: int, rear: int, lift: float
) -> None:
    """Put the command and what it aims at into `s`; a drive that is told to go goes faster by `lift`.

    The drive obeys the row `driven`, the servos `front` and `rear`.
    """
    if commands[front, 1] != s[FRONT_COMMAND]:
        s[FRONT_BEFORE] = s[FRONT_AIM]
    if commands[rear, 2] != s[REAR_COMMAND]:
        s[REAR_BEFORE] = s[REAR_AIM]
    s[DRIVE_COMMAND], s[FRONT_COMMAND], s[REAR_COMMAND] = commands[driven, 0], commands[front, 1], commands[rear, 2]
    s[FRONT_AIM], s[REAR_AIM], s[SPEED_AIM] = settled[front, 0], settled[rear, 1], settled[driven, 2]
    if settled[driven, 2] != 0.0:
        s[SPEED_AIM] += lift
    s[STEERING_LAG], s[STEERING_RATE], s[PLAY], s[ACCELERATE_LAG], s[BRAKE_LAG] = 0.0, math.inf, 0.0, 0.0, 0.0
    s[STEERING_INERTIA], s[STEERING_ACCELERATION] = 0.0, math.inf
    s[ACCELERATION_LIMIT] = s[BRAKING_LIMIT] = math.inf
    aim(s, p)


@compiled(inner=True, fast=True)
def _motion(s: Floats, p: Floats, front_axle_m: float, rear_axle_m: float) -> None:
    """Turn angles and speed in `s` into the body's motion (thesis eq. 5.6–5.8, corrected)."""
    steer(s, p)
    front, rear = s[FRONT], s[REAR]
    if front != s[KNOWN_FRONT] or rear != s[KNOWN_REAR]:
        s[KNOWN_FRONT], s[KNOWN_REAR] = front, rear
        s[COS_FRONT], s[COS_REAR] = math.cos(front), math.cos(rear)
        s[TAN_FRONT], s[TAN_REAR] = math.sin(front) / s[COS_FRONT], math.sin(rear) / s[COS_REAR]
    s[FRONT_SPEED] = s[REAR_SPEED] = s[SPEED]
    drive(s, p)
    forward = 0.5 * (s[FRONT_SPEED] * s[COS_FRONT] + s[REAR_SPEED] * s[COS_REAR])
    per_wheelbase = forward / (front_axle_m + rear_axle_m)
    s[FORWARD] = forward
    s[LEFT] = per_wheelbase * (front_axle_m * s[TAN_REAR] + rear_axle_m * s[TAN_FRONT])
    s[YAW_RATE] = per_wheelbase * (s[TAN_FRONT] - s[TAN_REAR])
    move(s, p)


@compiled(inner=True, fast=True)
def _step(
    s: Floats, p: Floats, plan: Floats, work: Floats, vehicle: Floats, begin: float, tau: float, length: float,
    start: Floats,
) -> None:  # fmt: skip
    """Fill `work` for a step of `length` from `tau` after `begin`; `start` is the pose there and the distance."""
    x_rate, y_rate = s[X_RATE], s[Y_RATE]
    for i in range(_COUNT):
        elapsed = _NODES[i] * length
        actuate(plan, tau + elapsed, s)
        s[TIME] = begin + tau + elapsed
        s[HOURS] = vehicle[_STARTED] + s[TIME] / _SECONDS_PER_HOUR
        # Good enough for what depends on the place: the velocity at the last node.
        s[X], s[Y], s[HEADING] = start[0] + elapsed * x_rate, start[1] + elapsed * y_rate, start[2]
        s[DISTANCE] = start[3] + elapsed * abs(s[SPEED])
        _motion(s, p, vehicle[_FRONT_AXLE], vehicle[_REAR_AXLE])
        work[_AHEAD + i], work[_ASIDE + i], work[_TURN + i] = s[FORWARD], s[LEFT], s[YAW_RATE]
    for i in range(_COUNT):
        turned = 0.0
        for j in range(_COUNT):
            turned += _TO_NODES[i, j] * work[_TURN + j]
        heading = start[2] + length * turned
        cosine, sine = math.cos(heading), math.sin(heading)
        s[HEADING] = heading
        s[FORWARD], s[LEFT], s[YAW_RATE] = work[_AHEAD + i], work[_ASIDE + i], work[_TURN + i]
        s[X_RATE] = cosine * s[FORWARD] - sine * s[LEFT]
        s[Y_RATE] = sine * s[FORWARD] + cosine * s[LEFT]
        drift(s, p)
        work[_ALONG_X + i], work[_ALONG_Y + i], work[_TURNED + i] = s[X_RATE], s[Y_RATE], s[YAW_RATE]


@compiled(inner=True)
def _see_step(s: Floats, p: Floats, work: Floats, start: Floats, length: float) -> None:
    """Note what a camera that smooths sees in a step."""
    for i in range(_COUNT + 1):
        x, y, heading = start[0], start[1], start[2]
        if i > 0:
            for j in range(_COUNT):
                x += length * _TO_NODES[i - 1, j] * work[_ALONG_X + j]
                y += length * _TO_NODES[i - 1, j] * work[_ALONG_Y + j]
                heading += length * _TO_NODES[i - 1, j] * work[_TURNED + j]
        s[X], s[Y], s[HEADING] = x, y, heading
        _look(s, p)
        for channel in range(3):
            work[_SMOOTH + channel * (_COUNT + 1) + i] = s[SEEN_X + channel]
    bend(work, _SMOOTH)


@compiled(inner=True)
def _follow_seen(s: Floats, work: Floats, start: Floats, length: float, share: float, out: Floats) -> None:
    """Report what a camera that smooths makes of a share of a step."""
    for i in range(3):
        out[i] = smoothed(work, _SMOOTH + i * (_COUNT + 1), start[4 + i], length / s[SEEN_LAG], share)


@compiled(inner=True, fast=True)
def _frames(
    s: Floats, p: Floats, work: Floats, start: Floats, now: float, length: float, t_s: Floats, out: Floats, k: int,
    stop: int,
) -> int:  # fmt: skip
    """Report the frames captured in a step from `now`; return the next one."""
    when = capture(s, t_s[k], p)
    while when <= now + length:
        elapsed = when - now
        share = elapsed / length
        x = y = heading = 0.0
        for j in range(_COUNT):
            weight = elapsed * (_BASIS[j, 0] + share * (_BASIS[j, 1] + share * (_BASIS[j, 2] + share * _BASIS[j, 3])))
            x += weight * work[_ALONG_X + j]
            y += weight * work[_ALONG_Y + j]
            heading += weight * work[_TURNED + j]
        s[X], s[Y], s[HEADING] = start[0] + x, start[1] + y, start[2] + heading
        if s[SEEN_LAG] > 0.0:
            _follow_seen(s, work, start, length, share, out[k])
        else:
            _report(s, p, out, k)
        k += 1
        if k == stop:
            break
        when = capture(s, t_s[k], p)
    return k


@compiled(inner=True, fast=True)
def _end_step(work: Floats, start: Floats, length: float) -> None:
    ahead = 0.0
    for j in range(_COUNT):
        weight = _WEIGHTS[j] * length
        start[0] += weight * work[_ALONG_X + j]
        start[1] += weight * work[_ALONG_Y + j]
        start[2] += weight * work[_TURNED + j]
        ahead += weight * abs(work[_AHEAD + j])
    start[3] += ahead


@compiled(inner=True)
def _wait(s: Floats, p: Floats, start: Floats, until: float, t_s: Floats, out: Floats, k: int, stop: int) -> int:
    """Report the pose at the start for every frame captured up to `until`; return the next one."""
    while k < stop and capture(s, t_s[k], p) <= until:
        s[X], s[Y], s[HEADING] = start[0], start[1], start[2]
        _report(s, p, out, k)
        k += 1
    return k


@compiled(inner=True)
def _hold(
    s: Floats,
    p: Floats,
    plan: Floats,
    work: Floats,
    vehicle: Floats,
    begin: float,
    duration: float,
    start: Floats,
    t_s: Floats,
    out: Floats,
    k: int,
    stop: int,
) -> int:
    """Drive one command for `duration` seconds, or to the last frame; return the next frame."""
    tau, longest = 0.0, min(vehicle[_STEP], _FIRST_STEP_S)
    while tau < duration and k < stop:
        length = step_length(plan, tau, longest)
        is_last = length > duration - tau - _TOGETHER
        if is_last:
            length = duration - tau
        _step(s, p, plan, work, vehicle, begin, tau, length, start)
        if s[SEEN_LAG] > 0.0:
            _see_step(s, p, work, start, length)
        k = _frames(s, p, work, start, begin + tau, length, t_s, out, k, stop)
        if s[SEEN_LAG] > 0.0:
            _follow_seen(s, work, start, length, 1.0, start[4:])
        _end_step(work, start, length)
        if is_last:
            break
        tau += length
        turning = min(max(abs(work[_TURN + _COUNT - 1]), _TURN_PER_STEP), _FASTEST_TURN)
        longest = min(vehicle[_STEP], _TURN_PER_STEP / turning)
    return k


@compiled(inner=True)
def _ahead(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, speed: float) -> float:
    """Return how fast the centroid moves ahead at this speed of the drive, as the axles stand."""
    s[TIME] = now
    s[HOURS] = vehicle[_STARTED] + now / _SECONDS_PER_HOUR
    s[FRONT], s[REAR], s[SPEED] = servos[2], servos[3], speed
    _motion(s, p, vehicle[_FRONT_AXLE], vehicle[_REAR_AXLE])
    return float(s[FORWARD])


@compiled(inner=True)
def _drive_speed(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, ahead: float) -> float:
    """Return the drive's speed with which the centroid moves `ahead`: one is a part of the other."""
    if ahead == 0.0:
        return 0.0
    part = _ahead(s, p, vehicle, servos, now, ahead) / ahead
    return ahead / part if part > _LEAST_PART else ahead


@compiled(inner=True)
def _lift(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, lately: float, speed: float) -> float:
    """Return by how much the drive has lately been faster than its commands made it, so far as it is not scatter."""
    scatter = vehicle[_LEVEL_SCATTER]
    if scatter == math.inf:
        return 0.0
    told = _ahead(s, p, vehicle, servos, now, servos[5])
    factor = (told * lately + _LEVEL_MPS**2) / (told * told + _LEVEL_MPS**2)
    off = math.log(factor) if factor > 0.0 else 0.0
    if off == 0.0:
        return 0.0
    believed = 1.0 / (1.0 + (scatter / off) ** 4)
    return float(believed * (_drive_speed(s, p, vehicle, servos, now, speed) - servos[5]))


@compiled(inner=True)
def _see_late(s: Floats, p: Floats, vehicle: Floats, servos: Floats, now: float, start: Floats) -> None:
    """Move the start ahead of what a camera reports that smooths: it is behind as in a steady motion."""
    _ahead(s, p, vehicle, servos, now, servos[4])
    cosine, sine, lag = math.cos(start[2]), math.sin(start[2]), s[SEEN_LAG]
    start[0] += lag * (cosine * s[FORWARD] - sine * s[LEFT])
    start[1] += lag * (sine * s[FORWARD] + cosine * s[LEFT])
    start[2] += lag * s[YAW_RATE]


@compiled(inner=True)
def _drive_run(
    s: Floats,
    p: Floats,
    plan: Floats,
    work: Floats,
    vehicle: Floats,
    begin: float,
    speed: float,
    lately: float,
    commands: Floats,
    settled: Floats,
    command_t_s: Floats,
    first: int,
    last: int,
    start: Floats,
    servos: Floats,
    t_s: Floats,
    out: Floats,
    k: int,
    stop: int,
) -> None:
    """Drive one run, whose pose is held until `begin`; actuators obey what comes before."""
    now, lift = -math.inf, 0.0
    # At first nothing was before.
    s[FRONT_COMMAND], s[REAR_COMMAND] = commands[first, 1], commands[first, 2]
    s[FRONT_BEFORE], s[REAR_BEFORE] = settled[first, 0], settled[first, 1]
    driven = front = rear = first
    while now < math.inf:
        to_front = arrive(s, command_t_s[front + 1], p) if front < last else math.inf
        to_rear = arrive(s, command_t_s[rear + 1], p) + s[REAR_WAIT] if rear < last else math.inf
        to_drive = arrive(s, command_t_s[driven + 1], p) + s[DRIVE_WAIT] if driven < last else math.inf
        end = min(to_front, to_rear, to_drive)
        _obey(s, p, commands, settled, driven, front, rear, lift)
        if now == -math.inf:
            # At rest at neutral, for as long as it may have been.
            servos[0] = servos[2] = s[FRONT_AIM]
            servos[1] = servos[3] = s[REAR_AIM]
            servos[4] = servos[5] = servos[6] = servos[7] = 0.0
            now = min(begin, end)
        elif now < begin:
            until = min(begin, end)
            plan_command(plan, s, servos)
            leave_command(plan, until - now, servos)
            servos[5] += (servos[4] - servos[5]) * -math.expm1((now - until) / LATELY_S)
            now = until
        if now < end:
            if now == begin:
                if not math.isnan(speed):
                    lift = _lift(s, p, vehicle, servos, now, lately, speed)
                    servos[4] = _drive_speed(s, p, vehicle, servos, now, speed)
                    _obey(s, p, commands, settled, driven, front, rear, lift)
                if s[SEEN_LAG] > 0.0:
                    _see_late(s, p, vehicle, servos, now, start)
            plan_command(plan, s, servos)
            k = _hold(s, p, plan, work, vehicle, now, end - now, start, t_s, out, k, stop)
            if k == stop:
                break
            leave_command(plan, end - now, servos)
        now = end
        front += to_front <= end
        rear += to_rear <= end
        driven += to_drive <= end


@compiled()
def simulate(
    vehicle: Floats,
    p: Floats,
    initial: Floats,
    begins_s: Floats,
    started_h: Floats,
    commands: Floats,
    settled: Floats,
    command_t_s: Floats,
    command_starts: Integers,
    t_s: Floats,
    starts: Integers,
    chosen: Integers,
    out: Floats,
) -> None:
    """Simulate the chosen runs of a batch.

    Parameters
    ----------
    vehicle
        (5,): distances of front and rear axle from the marker centroid, longest step; the fourth is for the loop; and
        how far, as a logarithm, the speed at the start may be from what the commands before it made it by mere scatter:
        beyond that the drive runs at another level (∞: never).
    p
        Every effect's parameters.
    initial
        (runs, 4): the measured pose at the start, and the speed ahead there (NaN: what the commands before made it); or
        (runs, 5) with the speed ahead lately, which tells the drive's level.
    begins_s
        (runs,): stamp of the measured pose at the start; NaN where the vehicle stands until its first command.
    started_h
        (runs,): when each run began, in hours since the session began.
    commands, settled
        (rows, 3): commands (drive, front, rear) from neutral; settled angles and speed (front, rear, drive).
    command_t_s, command_starts
        (rows,), (runs + 1,): when each command was given, the first of a run at −∞; where each run's rows begin.
    t_s, starts
        (frames,), (runs + 1,): stamps asked for, and where each run's begin.
    chosen
        Runs to simulate.
    out
        (frames, 3): receives x, y, heading.
    """
    s, plan, work = np.zeros(SIZE), np.zeros(PLAN_SIZE), np.zeros(_WORK_SIZE)
    servos, start = np.zeros(SERVOS_SIZE), np.zeros(_START_SIZE)
    s[KNOWN_FRONT] = math.nan
    for run in chosen:
        k, stop = starts[run], starts[run + 1]
        if k == stop:
            continue
        first, last = command_starts[run], command_starts[run + 1] - 1
        vehicle[_STARTED] = started_h[run]
        s[X_RATE] = s[Y_RATE] = 0.0
        _start(s, p, initial, run)
        start[0], start[1], start[2], start[3] = s[X], s[Y], s[HEADING], 0.0
        start[4], start[5], start[6] = initial[run, 0], initial[run, 1], initial[run, 2]
        begin = arrive(s, command_t_s[first + 1], p) + min(0.0, s[REAR_WAIT], s[DRIVE_WAIT])
        if not math.isnan(begins_s[run]):
            begin = capture(s, begins_s[run], p)
        k = _wait(s, p, start, begin, t_s, out, k, stop)
        speed = initial[run, 3]
        lately = initial[run, 4] if initial.shape[1] > _STATE else speed
        if k < stop:
            _drive_run(
                s, p, plan, work, vehicle, begin, speed, lately, commands, settled, command_t_s, first, last, start,
                servos, t_s, out, k, stop,
            )  # fmt: skip
