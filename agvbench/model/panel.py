"""One panel of the rollout: integrate heading and position over a stretch of time, and evaluate them inside.

Everything about a panel lies in one flat working array at fixed offsets, and every loop has a fixed length: in this
form the compiler knows that nothing overlaps and turns the loops into vector instructions, series included.
"""

from __future__ import annotations

import math

from agvbench.model.compiled import compiled
from agvbench.model.quadrature import (
    COSINE,
    COUNT,
    ELAPSED,
    EXPONENTIAL,
    PADDED,
    SINE,
    TO_COEFFICIENTS,
    TO_LAST,
    TO_LAST_BUT_ONE,
    TO_NODES,
    WEIGHTS,
)
from agvbench.types import Floats

# Offsets into the working array. At the nodes: axle angles, speed; displacement per unit of s forward and left in the
# vehicle frame, along x and y in the floor frame, and in heading.
FRONT, REAR, SPEED, FORWARD, LEFT, ALONG_X, ALONG_Y, YAW = range(0, 8 * COUNT, COUNT)
# Heading turned since the start of the panel, at the nodes; polynomials in s: all padded.
TURNED, X, Y, HEADING = range(8 * COUNT, 8 * COUNT + 4 * PADDED, PADDED)
WORK_SIZE = 8 * COUNT + 4 * PADDED

# exp(x) = exp(x / 2⁶)^(2⁶); below −40 nothing is left at the 1e-17 that a double resolves.
_HALVINGS, _LEAST_EXPONENT = 6, -40.0


@compiled(fast=True, inner=True, inline=True)
def _sine(x: float) -> float:
    square = x * x
    total: float = SINE[10]
    for k in range(9, -1, -1):
        total = SINE[k] + square * total
    return x * total


@compiled(fast=True, inner=True, inline=True)
def _cosine(x: float) -> float:
    square = x * x
    total: float = COSINE[11]
    for k in range(10, -1, -1):
        total = COSINE[k] + square * total
    return total


@compiled(fast=True, inner=True, inline=True)
def _decay(x: float) -> float:
    x = max(x, _LEAST_EXPONENT) / 2.0**_HALVINGS
    total: float = EXPONENTIAL[14]
    for k in range(13, -1, -1):
        total = EXPONENTIAL[k] + x * total
    for _ in range(_HALVINGS):
        total *= total
    return total


@compiled(fast=True, inner=True)
def fill_nodes(work: Floats, state: Floats, target: Floats, steering_ratio: float, speed_ratio: float) -> None:
    """Put axle angles and speed at the nodes: first-order lags from `state` (…, front, rear, speed) to `target`.

    The ratios are the panel's length over the time constants, infinite for a constant of zero.
    """
    # In names of their own, since the compiler cannot know that `work` does not overlap.
    front, rear, speed = target[0], target[1], target[2]
    front_gap, rear_gap, speed_gap = state[3] - front, state[4] - rear, state[5] - speed
    for i in range(COUNT):
        steering_left, speed_left = _decay(-steering_ratio * ELAPSED[i]), _decay(-speed_ratio * ELAPSED[i])
        work[FRONT + i] = front + front_gap * steering_left
        work[REAR + i] = rear + rear_gap * steering_left
        work[SPEED + i] = speed + speed_gap * speed_left


@compiled(fast=True, inner=True, inline=True)
def _project(work: Floats, matrix: Floats, source: int, target: int) -> float:
    """Put `matrix` times the row `source` into `target`; return the sum of it, the polynomial's value at s = 1."""
    # In names of their own, since the compiler cannot know that `target` does not overlap.
    v0, v1, v2, v3 = work[source], work[source + 1], work[source + 2], work[source + 3]
    v4, v5, v6, v7 = work[source + 4], work[source + 5], work[source + 6], work[source + 7]
    total = 0.0
    for k in range(PADDED):
        low = matrix[k] * v0 + matrix[12 + k] * v1 + matrix[24 + k] * v2 + matrix[36 + k] * v3
        high = matrix[48 + k] * v4 + matrix[60 + k] * v5 + matrix[72 + k] * v6 + matrix[84 + k] * v7
        work[target + k] = low + high
        total += low + high
    return total


@compiled(fast=True, inner=True, inline=True)
def _size_of_term(work: Floats, weights: Floats) -> float:
    """Return how large one Legendre coefficient of the displacements is."""
    x = y = yaw = 0.0
    for i in range(COUNT):
        x += weights[i] * work[ALONG_X + i]
        y += weights[i] * work[ALONG_Y + i]
        yaw += weights[i] * work[YAW + i]
    return abs(x) + abs(y) + abs(yaw)


@compiled(fast=True, inner=True)
def integrate(
    work: Floats, heading: float, front_axle_m: float, rear_axle_m: float, length: float
) -> tuple[float, float]:
    """Turn axle angles and speed at the nodes into displacements at the nodes.

    Returns
    -------
    error
        Estimate of the error inside the panel [m and rad]: the next term of a geometric series.
    turned
        By how much the heading turns at most [rad]; the result is void if that is more than `SERIES_LIMIT`.
    """
    quarter, per_wheelbase = 0.25 * length, 1.0 / (front_axle_m + rear_axle_m)
    for i in range(COUNT):
        cos_front, cos_rear = _cosine(work[FRONT + i]), _cosine(work[REAR + i])
        forward = quarter * work[SPEED + i] * (cos_front + cos_rear)
        share = forward * per_wheelbase / (cos_front * cos_rear)
        from_front = _sine(work[FRONT + i]) * cos_rear * share
        from_rear = _sine(work[REAR + i]) * cos_front * share
        work[FORWARD + i] = forward
        work[LEFT + i] = front_axle_m * from_rear + rear_axle_m * from_front
        work[YAW + i] = from_front - from_rear
    _project(work, TO_NODES, YAW, TURNED)
    cos_start, sin_start = math.cos(heading), math.sin(heading)
    for i in range(COUNT):
        cos_turned, sin_turned = _cosine(work[TURNED + i]), _sine(work[TURNED + i])
        c, s = cos_start * cos_turned - sin_start * sin_turned, sin_start * cos_turned + cos_start * sin_turned
        work[ALONG_X + i] = c * work[FORWARD + i] - s * work[LEFT + i]
        work[ALONG_Y + i] = s * work[FORWARD + i] + c * work[LEFT + i]
    turned = 0.0
    for i in range(COUNT):
        turned += WEIGHTS[i] * abs(work[YAW + i])
    last, last_but_one = _size_of_term(work, TO_LAST), _size_of_term(work, TO_LAST_BUT_ONE)
    return last * last / (last + last_but_one + 1e-30), turned


@compiled(fast=True, inner=True)
def advance(work: Floats, state: Floats) -> None:
    """Make polynomials of the panel in the working array; take the pose in `state` (x, y, heading, …) to its end."""
    along_x = _project(work, TO_COEFFICIENTS, ALONG_X, X)
    along_y = _project(work, TO_COEFFICIENTS, ALONG_Y, Y)
    turned = _project(work, TO_COEFFICIENTS, YAW, HEADING)
    work[X] += state[0]
    work[Y] += state[1]
    work[HEADING] += state[2]
    state[0] += along_x
    state[1] += along_y
    state[2] += turned


@compiled(fast=True, inner=True)
def evaluate(work: Floats, middle_s: float, length: float, t_s: Floats, out: Floats, first: int, stop: int) -> None:
    """Evaluate the panel's polynomials at ``t_s[first:stop]``, into that part of `out` (3, times)."""
    x0, x1, x2, x3, x4 = work[X], work[X + 1], work[X + 2], work[X + 3], work[X + 4]
    x5, x6, x7, x8 = work[X + 5], work[X + 6], work[X + 7], work[X + 8]
    y0, y1, y2, y3, y4 = work[Y], work[Y + 1], work[Y + 2], work[Y + 3], work[Y + 4]
    y5, y6, y7, y8 = work[Y + 5], work[Y + 6], work[Y + 7], work[Y + 8]
    h0, h1, h2, h3, h4 = work[HEADING], work[HEADING + 1], work[HEADING + 2], work[HEADING + 3], work[HEADING + 4]
    h5, h6, h7, h8 = work[HEADING + 5], work[HEADING + 6], work[HEADING + 7], work[HEADING + 8]
    scale = 2.0 / length
    for i in range(first, stop):
        s = (t_s[i] - middle_s) * scale
        out[0, i] = x0 + s * (x1 + s * (x2 + s * (x3 + s * (x4 + s * (x5 + s * (x6 + s * (x7 + s * x8)))))))
        out[1, i] = y0 + s * (y1 + s * (y2 + s * (y3 + s * (y4 + s * (y5 + s * (y6 + s * (y7 + s * y8)))))))
        out[2, i] = h0 + s * (h1 + s * (h2 + s * (h3 + s * (h4 + s * (h5 + s * (h6 + s * (h7 + s * h8)))))))
