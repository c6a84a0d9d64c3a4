"""The loop of the simulation over runs, commands and steps, from command to measured pose.

Steps end where a command takes effect and where the motion of an actuator has a kink, so that all quantities are smooth
within a step.

The imported stages do nothing. The kernel contains the text of this file and of the files that it calls, with the hooks
of the effects in place of the stages; see `agvbench.model.simulation.compose`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.effects.state import (
    DISTANCE,
    DRIVE_WAIT,
    FRONT,
    FRONT_AIM,
    HEADING,
    HOURS,
    KNOWN_FRONT,
    KNOWN_REAR,
    LOGGED,
    MEASURED_WEIGHT,
    MEASURED_YAW_RATE,
    REAR_AIM,
    REAR_WAIT,
    ROLLED,
    SEEN_LAG,
    SIZE,
    SPEED,
    SPEED_AIM,
    TIME,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators.gaps import TOGETHER
from agvbench.model.simulation.actuators.plan import PLAN_SIZE, SERVOS_SIZE, leave_command, plan_command, step_length
from agvbench.model.simulation.commands import next_drive, obey, reset_memory
from agvbench.model.simulation.filtered_speed import (
    FILTER_SIZE,
    filter_speed,
    position_error,
    reset_filter,
    speed_error,
)
from agvbench.model.simulation.frames import follow_seen, report_step, see_step, start_run, wait
from agvbench.model.simulation.layout import (
    BANDWIDTH,
    COUNT,
    INITIAL_SPEED,
    INITIAL_YAW_RATE,
    LONGEST_STEP,
    RECENT_SPEED,
    START_ROLLED,
    START_SIZE,
    STARTED,
    TURN,
    WORK_SIZE,
    YAW_RATE_WEIGHT,
)
from agvbench.model.simulation.level import drive_speed, front_correction, level_lift, limit_body, move_ahead, see_late
from agvbench.model.simulation.stages import adopt, arrive, capture
from agvbench.model.simulation.step import end_step, take_step
from agvbench.types import Floats

Integers = NDArray[np.int64]

# Length of the first step of a command, with unknown yaw rate [s]; rotation in a later step [rad; s below 1 rad/s].
_FIRST_STEP_S, _TURN_PER_STEP = 0.08, 0.3
# Limit of the yaw rate [rad/s]: invalid parameters must not make the loop endless.
_FASTEST_TURN = 150.0
# Recent speed: averaged with weights that fall with this time constant [s].
RECENT_SPEED_S = 0.5


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
    """Simulate one command for `duration` seconds, or to the last frame; return the next frame."""
    tau, longest = 0.0, min(vehicle[LONGEST_STEP], _FIRST_STEP_S)
    while tau < duration and k < stop:
        length = step_length(plan, tau, longest)
        is_last = length > duration - tau - TOGETHER
        if is_last:
            length = duration - tau
        take_step(s, p, plan, work, vehicle, begin, tau, length, start)
        if s[SEEN_LAG] > 0.0:
            see_step(s, p, work, start, length)
        k = report_step(s, p, work, start, begin + tau, length, t_s, out, k, stop)
        if s[SEEN_LAG] > 0.0:
            follow_seen(s, work, start, length, 1.0, start[4:])
        end_step(work, start, length)
        if is_last:
            break
        tau += length
        turning, speed = abs(work[TURN + COUNT - 1]), abs(s[SPEED])
        if speed > 0.0:
            # The drive may still speed up, or have come to rest to reverse.
            turning *= max(1.0, abs(s[SPEED_AIM]) / speed)
        longest = min(vehicle[LONGEST_STEP], _TURN_PER_STEP / min(max(turning, _TURN_PER_STEP), _FASTEST_TURN))
    return k


@compiled(inner=True)
def _rest(s: Floats, servos: Floats) -> None:
    """Let drive and servos be at rest, with the axles where the aims are."""
    servos[0] = servos[2] = s[FRONT_AIM]
    servos[1] = servos[3] = s[REAR_AIM]
    servos[4] = servos[5] = servos[6] = servos[7] = servos[8] = servos[9] = servos[10] = 0.0


@compiled(inner=True)
def _actuate_only(
    s: Floats,
    p: Floats,
    plan: Floats,
    vehicle: Floats,
    servos: Floats,
    filtered: Floats,
    bandwidth: float,
    now: float,
    until: float,
    begin: float,
) -> None:
    """Move the actuators from `now` to `until`, with the recent mean of the drive's speed and of its square."""
    limit_body(s, p, vehicle, now)
    plan_command(plan, s, servos)
    if bandwidth < math.inf:
        filter_speed(filtered, plan, bandwidth, now, until, begin)
    leave_command(plan, until - now, servos)
    recent = -math.expm1((now - until) / RECENT_SPEED_S)
    servos[5] += (servos[4] - servos[5]) * recent
    servos[9] += (servos[4] * servos[4] - servos[9]) * recent


@compiled(inner=True)
def _begin_in_motion(
    s: Floats, p: Floats, vehicle: Floats, servos: Floats, filtered: Floats, now: float, initial: Floats, start: Floats
) -> float:
    """Put the measured speed and yaw rate into `servos`, and the pose into `start`; return the lift of the level."""
    speed, weight = initial[INITIAL_SPEED], initial[YAW_RATE_WEIGHT]
    lift = level_lift(s, p, vehicle, servos, now, initial[RECENT_SPEED], speed)
    servos[4] = drive_speed(s, p, vehicle, servos, now, speed) + speed_error(filtered, servos[4])
    if initial[BANDWIDTH] < math.inf:
        move_ahead(s, p, vehicle, servos, now, position_error(filtered, initial[BANDWIDTH]), start)
    if weight > 0.0:
        s[FRONT], s[MEASURED_YAW_RATE], s[MEASURED_WEIGHT] = servos[2], initial[INITIAL_YAW_RATE], weight
        adopt(s, p)
        turned = weight * front_correction(s, p, vehicle, servos, now, initial[INITIAL_YAW_RATE])
        servos[0] += turned
        servos[2] += turned
    return float(lift)


@compiled(inner=True)
def _drive_run(
    s: Floats,
    p: Floats,
    plan: Floats,
    work: Floats,
    vehicle: Floats,
    begin: float,
    initial: Floats,
    commands: Floats,
    settled: Floats,
    command_t_s: Floats,
    first: int,
    last: int,
    start: Floats,
    servos: Floats,
    filtered: Floats,
    t_s: Floats,
    out: Floats,
    k: int,
    stop: int,
) -> None:
    """Simulate one run, whose pose is held until `begin`; commands before that move the actuators only."""
    now, lift = -math.inf, 0.0
    reset_filter(filtered)
    reset_memory(s, commands, settled, first, start[2])
    driven = front = rear = first
    while now < math.inf:
        obey(s, p, commands, settled, driven, front, rear, lift, now)
        to_front = arrive(s, command_t_s[front + 1], p) if front < last else math.inf
        to_rear = arrive(s, command_t_s[rear + 1], p) + s[REAR_WAIT] if rear < last else math.inf
        to_drive, next_driven = next_drive(s, p, settled, command_t_s, driven, last)
        end = min(to_front, to_rear, to_drive)
        if now == -math.inf:
            _rest(s, servos)
            now = min(begin, end)
        elif now < begin:
            until = min(begin, end)
            _actuate_only(s, p, plan, vehicle, servos, filtered, initial[BANDWIDTH], now, until, begin)
            now = until
        if now < end:
            if now == begin:
                if not math.isnan(initial[INITIAL_SPEED]):
                    lift = _begin_in_motion(s, p, vehicle, servos, filtered, now, initial, start)
                    obey(s, p, commands, settled, driven, front, rear, lift, now)
                if s[SEEN_LAG] > 0.0:
                    see_late(s, p, vehicle, servos, now, start)
            limit_body(s, p, vehicle, now)
            plan_command(plan, s, servos)
            k = _hold(s, p, plan, work, vehicle, now, end - now, start, t_s, out, k, stop)
            if k == stop:
                break
            leave_command(plan, end - now, servos)
        now = end
        front += to_front <= end
        rear += to_rear <= end
        driven = next_driven if to_drive <= end else driven


@compiled()
def simulate(
    vehicle: Floats,
    p: Floats,
    initial: Floats,
    begins_s: Floats,
    started_h: Floats,
    logged: Floats,
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
        (7,): distances of front and rear axle from the marker centroid, the front axle's share of the drive, longest
        step, a working value of the loop, the standard deviation of the logarithm of the initial speed over the speed
        that earlier commands result in (a larger deviation indicates another drive level; ∞: never), and 1 for a
        differential vehicle.
    p
        Every effect's parameters, then a number for each effect: 0 if all its parameters are at null.
    initial
        (runs, 8): how each run begins; see `Simulation.predict`.
    begins_s
        (runs,): time stamp of the initial pose; NaN for runs that are at rest until their first command.
    started_h
        (runs,): start of each run, in hours since the session began.
    logged
        (runs, LOGGED_COUNT): what was logged about each run, standardised.
    commands, settled
        (rows, 3): commands (drive, front, rear) from neutral; steady-state values (front, rear, speed).
    command_t_s, command_starts
        (rows,), (runs + 1,): time of each command, −∞ for the first of a run; index of each run's first row.
    t_s, starts
        (frames,), (runs + 1,): time stamps to report; index of each run's first frame.
    chosen
        Runs to simulate.
    out
        (frames, 3): receives x, y, heading.
    """
    s, plan, work = np.zeros(SIZE), np.zeros(PLAN_SIZE), np.zeros(WORK_SIZE)
    servos, start, filtered = np.zeros(SERVOS_SIZE), np.zeros(START_SIZE), np.zeros(FILTER_SIZE)
    s[KNOWN_FRONT] = s[KNOWN_REAR] = math.nan
    for run in chosen:
        k, stop = starts[run], starts[run + 1]
        if k == stop:
            continue
        first, last = command_starts[run], command_starts[run + 1] - 1
        vehicle[STARTED] = started_h[run]
        s[X_RATE] = s[Y_RATE] = s[YAW_RATE] = s[TIME] = s[DISTANCE] = s[ROLLED] = 0.0
        s[HOURS] = started_h[run]
        for i in range(logged.shape[1]):
            s[LOGGED + i] = logged[run, i]
        start_run(s, p, initial, run)
        start[0], start[1], start[2], start[3] = s[X], s[Y], s[HEADING], 0.0
        start[4], start[5], start[6], start[START_ROLLED] = initial[run, 0], initial[run, 1], initial[run, 2], 0.0
        begin = arrive(s, command_t_s[first + 1], p) + min(0.0, s[REAR_WAIT], s[DRIVE_WAIT])
        if not math.isnan(begins_s[run]):
            begin = capture(s, begins_s[run], p)
        k = wait(s, p, start, begin, t_s, out, k, stop)
        if k < stop:
            _drive_run(
                s, p, plan, work, vehicle, begin, initial[run], commands, settled, command_t_s, first, last, start,
                servos, filtered, t_s, out, k, stop,
            )  # fmt: skip
