"""The rollout's loop over runs, commands and panels.

Between two command changes (after the delay) the settled angles and speed are constant, so a lag is an exponential and
is known exactly; only heading and position are integrated, by collocation on panels as long as their error
allows (Hairer, Nørsett and Wanner 1993, section II.7). Poses are then read off the panels' polynomials, so that their
number hardly matters: a panel serves some ten to some hundred frames of a camera.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agvbench.model.compiled import compiled
from agvbench.model.panel import (
    WORK_SIZE,
    advance,
    evaluate,
    fill_nodes,
    integrate,
)
from agvbench.model.quadrature import SERIES_LIMIT
from agvbench.types import Floats

Integers = NDArray[np.int64]

#: What each number in a row of parameters is: the geometry, then ``effect.parameter``.
SLOTS = (
    "geometry.front_axle_m",
    "geometry.rear_axle_m",
    "actuation_delay.delay_s",
    "steering_lag.time_constant_s",
    "speed_lag.accelerate_s",
    "speed_lag.brake_s",
)

# Largest error inside a panel [m and rad]; at its end, collocation leaves far less, so that errors hardly add up.
_TOLERANCE = 1e-8
# First guess of a panel's length in time constants, and how a next one may grow.
_FIRST_GUESS, _LARGEST_GROWTH, _SAFETY = 1.0, 3.0, 0.85
# No vehicle needs shorter panels [s]: numbers that ask for them are nonsense, but must not hang the loop.
_SHORTEST_S = 1e-6


@compiled(inner=True)
def _settle(state: Floats, target: Floats, steering_ratio: float, speed_ratio: float) -> None:
    """Take axle angles and speed to the end of a panel; the ratios are its length over the time constants."""
    steering_left, speed_left = math.exp(-steering_ratio), math.exp(-speed_ratio)
    state[3] = target[0] + (state[3] - target[0]) * steering_left
    state[4] = target[1] + (state[4] - target[1]) * steering_left
    state[5] = target[2] + (state[5] - target[2]) * speed_left


@compiled(inner=True)
def _first_length(state: Floats, target: Floats, lag_s: float, speed_lag_s: float, length: float) -> float:
    """Return a first guess of the panel's length, at most `length`."""
    if state[3] != target[0] or state[4] != target[1]:
        length = min(length, _FIRST_GUESS * lag_s)
    if state[5] != target[2]:
        length = min(length, _FIRST_GUESS * speed_lag_s)
    return length


@compiled(inner=True)
def _stretch(
    work: Floats,
    state: Floats,
    vehicle: Floats,
    target: Floats,
    lag_s: float,
    speed_lag_s: float,
    start: float,
    end: float,
    t_s: Floats,
    out: Floats,
    k: int,
    stop: int,
) -> int:
    """Simulate from `start` to `end`, where target and time constants stay; return the next time to report."""
    now, length = start, _first_length(state, target, lag_s, speed_lag_s, end - start)
    while now < end:
        remaining = end - now
        if length >= remaining:
            length = remaining
        elif 2.0 * length > remaining:
            length = 0.5 * remaining
        while True:
            fill_nodes(work, state, target, length / lag_s, length / speed_lag_s)
            error, turned = integrate(work, state[2], vehicle[0], vehicle[1], length)
            if (error <= _TOLERANCE and turned <= SERIES_LIMIT) or length <= _SHORTEST_S:
                break
            length *= 0.5
        advance(work, state)
        following = end if length == remaining else now + length
        first = k
        while k < stop and t_s[k] <= following:
            k += 1
        middle = now + 0.5 * length
        evaluate(work, middle, length, t_s, out, first, k)
        _settle(state, target, length / lag_s, length / speed_lag_s)
        now = following
        # The error goes with the eighth power of the length.
        growth = _SAFETY * math.sqrt(math.sqrt(math.sqrt(_TOLERANCE / (error + 1e-30))))
        length = max(_SHORTEST_S, length * min(_LARGEST_GROWTH, growth))
    return k


@compiled(inner=True)
def _hold_command(
    work: Floats,
    state: Floats,
    vehicle: Floats,
    target: Floats,
    start: float,
    end: float,
    t_s: Floats,
    out: Floats,
    k: int,
    stop: int,
) -> int:
    """Simulate one command from `start` to `end`; return the next time to report."""
    lag_s, accelerate_s, brake_s = vehicle[3], vehicle[4], vehicle[5]
    if lag_s <= 0.0:
        state[3], state[4] = target[0], target[1]
    now = start
    while now < end:
        until, stands_s = end, math.inf
        speed_lag_s = accelerate_s if abs(target[2]) > abs(state[5]) else brake_s
        if state[5] * target[2] < 0.0:
            # Brake to rest first, whatever the target beyond it.
            speed_lag_s, stands_s = brake_s, now + brake_s * math.log((target[2] - state[5]) / target[2])
            until = min(end, stands_s)
        elif speed_lag_s <= 0.0:
            state[5] = target[2]
        k = _stretch(work, state, vehicle, target, lag_s, speed_lag_s, now, until, t_s, out, k, stop)
        if stands_s <= end:
            state[5] = 0.0
        now = until
    return k


@compiled(inner=True)
def _stand(state: Floats, t_s: Floats, until: float, out: Floats, k: int, stop: int) -> int:
    """Report the pose in `state` for every time up to `until`."""
    while k < stop and t_s[k] <= until:
        out[0, k], out[1, k], out[2, k] = state[0], state[1], state[2]
        k += 1
    return k


@compiled(inner=True)
def _copy_row(table: Floats, row: int, out: Floats) -> None:
    """Copy ``table[row]``: a slice would cost more than the numbers in it, by counting references."""
    for i in range(out.size):
        out[i] = table[row, i]


@compiled()
def simulate(
    parameters: Floats,
    initial: Floats,
    targets: Floats,
    command_t_s: Floats,
    command_starts: Integers,
    t_s: Floats,
    starts: Integers,
    out: Floats,
) -> None:
    """Simulate every run of a batch.

    Parameters
    ----------
    parameters
        (runs, len(SLOTS)).
    initial
        (runs, 6): x, y, heading, front and rear axle angle, speed until the first command takes effect.
    targets
        (commands, 3): settled front angle, rear angle, speed of each command, all runs one after another.
    command_t_s
        (commands,): when each command was given.
    command_starts
        (runs + 1,): where each run's commands begin.
    t_s, starts
        The same for the times to report, ascending within a run.
    out
        (3, times): receives x, y, heading.
    """
    work, state, vehicle, target = np.zeros(WORK_SIZE), np.empty(6), np.empty(6), np.empty(3)
    for run in range(len(initial)):
        _copy_row(initial, run, state)
        _copy_row(parameters, run, vehicle)
        k, stop = starts[run], starts[run + 1]
        if k == stop:
            continue
        first, last, delay = command_starts[run], command_starts[run + 1] - 1, vehicle[2]
        k = _stand(state, t_s, command_t_s[first] + delay, out, k, stop)
        for command in range(first, last + 1):
            start, end = command_t_s[command] + delay, t_s[stop - 1]
            if command < last:
                end = min(end, command_t_s[command + 1] + delay)
            if start >= end:
                break
            _copy_row(targets, command, target)
            k = _hold_command(work, state, vehicle, target, start, end, t_s, out, k, stop)
        _stand(state, t_s, math.inf, out, k, stop)
