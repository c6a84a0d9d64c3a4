# mypy: warn-return-any=False
"""The speed that the motion filter of a recording would find in the simulated past of a window.

A filter of white-noise jerk lags behind a drive that begins to accelerate. In steady state it is of third order, with
the poles of a Butterworth filter (B. D. O. Anderson and J. B. Moore, *Optimal Control: Linear Quadratic Methods*, 1990,
section 6.1)::

    p̂′ = v̂ + 2 ω e,   v̂′ = â + 2 ω² e,   â′ = ω³ e,   e = p − p̂

It is simulated with the drive's speed at evenly spaced times, between which the speed is taken for linear.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators import speed_at
from agvbench.model.simulation.gaps import TOGETHER
from agvbench.types import Floats

# Number of intervals, and their length in time constants 1 / ω of the filter.
_COUNT, _LENGTH = 10, 0.8
# Index of the next time, speed at the last one, then the filter: ω e, v̂ and â / ω.
_NEXT, _LAST, _ERROR, _FOUND, _RATE, FILTER_SIZE = range(6)
_UNDER_SPEED = np.array([[-2.0, -1.0, 0.0], [2.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def _transition() -> Floats:
    """Return (3, 5): how the filter's state and the speeds at both ends of an interval act on the state at its end."""
    of_speed = np.zeros((5, 5))
    of_speed[:3, :3] = _UNDER_SPEED
    of_speed[0, 3] = 1.0  # the speed at the beginning
    of_speed[3, 4] = 1.0 / _LENGTH  # its change over the interval
    whole = expm(_LENGTH * of_speed)[:3]
    whole[:, 3] -= whole[:, 4]
    return np.ascontiguousarray(whole)


_TRANSITION = _transition()


@compiled(inner=True)
def reset_filter(seen: Floats) -> None:
    """Let the filter have found nothing yet."""
    seen[:] = 0.0
    seen[_LAST] = math.nan


@compiled(inner=True)
def filter_speed(seen: Floats, plan: Floats, bandwidth: float, now: float, until: float, begin: float) -> None:
    """Move the filter from `now` to `until`, with the speed of the command in force; the window begins at `begin`."""
    interval = _LENGTH / bandwidth
    at = begin - (_COUNT - seen[_NEXT]) * interval
    while at <= until + TOGETHER and seen[_NEXT] <= _COUNT:
        if at >= now:
            speed = speed_at(plan, at - now)
            if math.isnan(seen[_LAST]):
                seen[_FOUND] = speed
            else:
                _advance(seen, speed)
            seen[_LAST] = speed
        seen[_NEXT] += 1.0
        at = begin - (_COUNT - seen[_NEXT]) * interval


@compiled(inner=True)
def _advance(seen: Floats, speed: float) -> None:
    """Move the filter over one interval, at whose end the drive has this speed."""
    before, error, found, rate = seen[_LAST], seen[_ERROR], seen[_FOUND], seen[_RATE]
    for k in range(3):
        row = _TRANSITION[k]
        seen[_ERROR + k] = row[0] * error + row[1] * found + row[2] * rate + row[3] * before + row[4] * speed


@compiled(inner=True)
def missed_speed(seen: Floats, speed: float) -> float:
    """Return by how much the drive, at this speed, is faster than the filter found; 0 if it has found nothing."""
    return 0.0 if math.isnan(seen[_LAST]) else speed - seen[_FOUND]


@compiled(inner=True)
def missed_distance(seen: Floats, bandwidth: float) -> float:
    """Return by how much the drive is ahead of where the filter found it [m]; 0 if it has found nothing."""
    return 0.0 if math.isnan(seen[_LAST]) else seen[_ERROR] / bandwidth


@compiled(inner=True)
def between(predicted: float, measured: float, stderr: float, deviation: float) -> float:
    """Return the speed between a predicted and a measured one, by the standard error of the measured one.

    `deviation` is the usual one of measured speeds from those that commands predict, beyond their standard error. Where
    it is small, a difference that the error explains is left to the prediction; a larger one is measured. The result is
    less than one standard error from the measured speed.
    """
    difference = measured - predicted
    known = difference * difference + deviation * deviation
    return predicted + (difference / (1.0 + 4.0 * stderr * stderr / known) if known > 0.0 else 0.0)
