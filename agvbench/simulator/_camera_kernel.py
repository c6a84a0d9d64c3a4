# mypy: disallow-untyped-decorators=False, warn-return-any=False
"""The camera's inner loop, compiled: small batches come by the thousand, and no frame may feel its neighbours."""

from __future__ import annotations

import math

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.types import Floats

# Options, in the order in which `Tracker` packs them.
RATE, LATENCY, LOST, UNTRACKED, BURST, DOUBLED, LATE, LATE_DELAY, WRONG, WRONG_SIZE = range(10)
# Columns of a frame's luck: random numbers in [0, 1), drawn whether needed or not.
IS_WRONG, JUMP, DIRECTION, TURN, BEGINS_BURST, BURST_LENGTH = range(6)
IS_LATE, LATE_BY, IS_LOST, IS_DOUBLED, DOUBLED_BY = range(6, 11)
LUCK = 11
# Rows of what is seen.
X, Y, HEADING, RESIDUAL = range(4)


@cached_njit()
def fit_body(pose: Floats, noise: Floats, markers: Floats, seen: Floats) -> None:
    """Write x, y, heading and rms residual of the rigid body fitted to noisy markers, least squares.

    `noise` is in the vehicle's frame, where it is as isotropic as in the floor's: shape (markers, 2).
    """
    count = len(markers)
    ahead = left = cosine = sine = squares = 0.0
    for j in range(count):
        mx, my, nx, ny = markers[j, 0], markers[j, 1], noise[j, 0], noise[j, 1]
        ahead += nx
        left += ny
        cosine += mx * (mx + nx) + my * (my + ny)
        sine += mx * ny - my * nx
    ahead, left = ahead / count, left / count
    turned = math.atan2(sine, cosine)
    c, s = math.cos(turned), math.sin(turned)
    for j in range(count):
        mx, my = markers[j, 0], markers[j, 1]
        dx, dy = mx + noise[j, 0] - ahead - (c * mx - s * my), my + noise[j, 1] - left - (s * mx + c * my)
        squares += dx * dx + dy * dy
    c, s = math.cos(pose[2]), math.sin(pose[2])
    seen[X] = pose[0] + c * ahead - s * left
    seen[Y] = pose[1] + s * ahead + c * left
    seen[HEADING] = math.pi - (math.pi - pose[2] - turned) % (2.0 * math.pi)
    seen[RESIDUAL] = math.sqrt(squares / count)


@cached_njit()
def misplace(luck: Floats, size_m: float, seen: Floats) -> None:
    """Throw a frame metres off, with any heading."""
    jump, direction = 2.0 * size_m * luck[JUMP], 2.0 * math.pi * luck[DIRECTION]
    seen[X] += jump * math.cos(direction)
    seen[Y] += jump * math.sin(direction)
    seen[HEADING] = math.pi * (1.0 - 2.0 * luck[TURN])


@cached_njit()
def burst_length(uniform: float, mean: float) -> int:
    """Return a whole number from 1, geometric with the given mean."""
    if mean <= 1.0:
        return 1
    return 1 + int(math.log1p(-uniform) / math.log1p(-1.0 / mean))


@cached_njit()
def _insert(received_s: Floats, order: np.ndarray, count: int, when: float, index: int) -> int:
    """Insert an arrival behind all that arrived no later; return the new count."""
    at = count
    while at > 0 and received_s[at - 1] > when:
        received_s[at], order[at] = received_s[at - 1], order[at - 1]
        at -= 1
    received_s[at], order[at] = when, index
    return count + 1


@cached_njit()
def observe(
    t_s: Floats, poses: Floats, noise: Floats, luck: Floats, markers: Floats, options: Floats, burst_left: int
) -> tuple[Floats, np.ndarray, Floats, np.ndarray, int]:
    """Return what is seen (n, 4), whether tracked (n,), arrival times and indices in order of arrival, rest of a burst.

    `noise` has shape (n, markers, 2) [m], `luck` (n, LUCK).
    """
    n = len(t_s)
    seen, tracked = np.empty((n, 4)), np.ones(n, dtype=np.bool_)
    received_s, order, count = np.empty(2 * n), np.empty(2 * n, dtype=np.int64), 0
    for i in range(n):
        fit_body(poses[i], noise[i], markers, seen[i])
        if luck[i, IS_WRONG] < options[WRONG]:
            misplace(luck[i], options[WRONG_SIZE], seen[i])
        if luck[i, BEGINS_BURST] < options[UNTRACKED]:
            burst_left = max(burst_left, burst_length(luck[i, BURST_LENGTH], options[BURST]))
        if burst_left > 0:
            burst_left -= 1
            tracked[i] = False
            seen[i] = math.nan
        if luck[i, IS_LOST] < options[LOST]:
            continue
        arrives = t_s[i] + options[LATENCY]
        if luck[i, IS_LATE] < options[LATE]:
            arrives -= options[LATE_DELAY] * math.log1p(-luck[i, LATE_BY])
        count = _insert(received_s, order, count, arrives, i)
        if luck[i, IS_DOUBLED] < options[DOUBLED]:
            count = _insert(received_s, order, count, arrives + luck[i, DOUBLED_BY] / options[RATE], i)
    return seen, tracked, received_s[:count].copy(), order[:count].copy(), burst_left
