# mypy: warn-return-any=False
"""The systematic part of what a camera sees, compiled: noise and faults belong to `agvbench.simulator.Camera`."""

from __future__ import annotations

import math

from agvbench.compiled import cached_njit
from agvbench.simulator.hidden.constants import LENS, MARKER_FORWARD, MARKER_LEFT, SCALE, TURNED
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
