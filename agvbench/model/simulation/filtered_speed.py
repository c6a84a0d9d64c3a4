# mypy: warn-return-any=False
"""The speed that the motion filter of a recording would find in the simulated past of a window.

A filter of white-noise jerk lags behind a drive that begins to accelerate. In steady state it is of third order, with
the poles of a Butterworth filter (B. D. O. Anderson and J. B. Moore, *Optimal Control: Linear Quadratic Methods*, 1990,
section 6.1)::

    p̂′ = v̂ + 2 ω e,   v̂′ = â + 2 ω² e,   â′ = ω³ e,   e = p − p̂

It is simulated in steps within which the drive's speed is taken for linear. No step reaches over a command, at which a
drive without a lag jumps to another speed.
"""

from __future__ import annotations

import math

from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators.gaps import TOGETHER
from agvbench.model.simulation.actuators.plan import speed_at
from agvbench.types import Floats

# How long before a window it is simulated, and its longest step, in time constants 1 / ω of the filter.
_BEFORE, _LONGEST = 8.0, 0.8
# The state of the filter: ω e, v̂ and â / ω.
_ERROR, _FOUND, _RATE, FILTER_SIZE = range(4)
# Terms of the Taylor series of a step: the next one is below 1e-4 of the state.
_TERMS = 6


@compiled(inner=True)
def reset_filter(filtered: Floats) -> None:
    """Let the filter have found nothing yet."""
    filtered[_ERROR], filtered[_FOUND], filtered[_RATE] = 0.0, math.nan, 0.0


@compiled(inner=True)
def filter_speed(filtered: Floats, plan: Floats, bandwidth: float, now: float, until: float, begin: float) -> None:
    """Move the filter from `now` to `until`, with the speed of the command in force; the window begins at `begin`."""
    at = max(now, begin - _BEFORE / bandwidth)
    if until - at <= TOGETHER:
        return
    speed = speed_at(plan, at - now)
    if math.isnan(filtered[_FOUND]):
        filtered[_FOUND] = speed
    while until - at > TOGETHER:
        length = min(until - at, _LONGEST / bandwidth)
        at += length
        last, speed = speed, speed_at(plan, at - now)
        _advance(filtered, bandwidth * length, last, speed)


@compiled(inner=True)
def _advance(filtered: Floats, length: float, before: float, after: float) -> None:
    """Move the filter over a step of a `length` in time constants, with the drive's speed `before` it and `after`."""
    error, found, rate = filtered[_ERROR], filtered[_FOUND], filtered[_RATE]
    error, found, rate = before - found - 2.0 * error, 2.0 * error + rate, error
    power = length
    filtered[_ERROR] += power * error
    filtered[_FOUND] += power * found
    filtered[_RATE] += power * rate
    change = (after - before) / length
    for k in range(2, _TERMS + 1):
        error, found, rate = change - found - 2.0 * error, 2.0 * error + rate, error
        change = 0.0
        power *= length / k
        filtered[_ERROR] += power * error
        filtered[_FOUND] += power * found
        filtered[_RATE] += power * rate


@compiled(inner=True)
def speed_error(filtered: Floats, speed: float) -> float:
    """Return by how much the drive, at this speed, is faster than the filter found; 0 if it has found nothing."""
    return 0.0 if math.isnan(filtered[_FOUND]) else speed - filtered[_FOUND]


@compiled(inner=True)
def position_error(filtered: Floats, bandwidth: float) -> float:
    """Return by how much the drive is ahead of where the filter found it [m]; 0 if it has found nothing."""
    return 0.0 if math.isnan(filtered[_FOUND]) else filtered[_ERROR] / bandwidth
