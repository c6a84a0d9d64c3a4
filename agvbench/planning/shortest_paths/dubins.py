"""The shortest path of a vehicle that only drives forward and cannot turn tighter than a radius.

Dubins (1957): it is one of six words of three pieces, LSL, RSR, LSR, RSL, LRL, RLR. Each is solved from the
triangle of its circles' centres; a word that begins with a right turn is its mirror image solved for the
mirrored goal, so there are three formulas and not six. All work on arrays of goals.

References
----------
L. E. Dubins, "On curves of minimal length with a constraint on average curvature, and with prescribed initial
and terminal positions and tangents", American Journal of Mathematics 79 (1957), 497-516.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np

from agvbench.planning.shortest_paths.pieces import RESOLUTION, Piece, by_length, path_of, require_solvable
from agvbench.types import Floats, Pose

WORDS = ("LSL", "RSR", "LSR", "RSL", "LRL", "RLR")
_TURN = 2.0 * math.pi


def _positive(angle_rad: Floats) -> Floats:
    """Wrap to [0, 2π), where what rounding made a full circle is nothing."""
    angle = np.mod(angle_rad, _TURN)
    return np.where(angle > _TURN - RESOLUTION, 0.0, angle)


def _left_straight_left(x: Floats, y: Floats, heading: Floats) -> Floats:
    centre_x, centre_y = x - np.sin(heading), y + np.cos(heading) - 1.0
    course = np.arctan2(centre_y, centre_x)
    straight = np.hypot(centre_x, centre_y)
    # Concentric circles: no straight, and all of the turn is in the first arc.
    course = np.where(straight < RESOLUTION, heading, course)
    return np.stack([_positive(course), straight, _positive(heading - course)])


def _left_straight_right(x: Floats, y: Floats, heading: Floats) -> Floats:
    centre_x, centre_y = x + np.sin(heading), y - np.cos(heading) - 1.0
    with np.errstate(invalid="ignore"):
        straight = np.sqrt(centre_x**2 + centre_y**2 - 4.0)  # NaN: the circles overlap, there is no such path
    course = np.arctan2(centre_y, centre_x) + np.arctan2(2.0, straight)
    return np.stack([_positive(course), straight, _positive(course - heading)])


def _left_right_left(x: Floats, y: Floats, heading: Floats) -> Floats:
    centre_x, centre_y = x - np.sin(heading), y + np.cos(heading) - 1.0
    quarter = 0.25 * np.hypot(centre_x, centre_y)
    with np.errstate(invalid="ignore"):
        middle = _TURN - 2.0 * np.arcsin(quarter)  # the long way round; NaN: too far apart
        course = np.arctan2(centre_y, centre_x) + np.arccos(quarter) + 0.5 * math.pi
    return np.stack([_positive(course), middle, _positive(heading - course + middle)])


def word_lengths(starts: Floats, goals: Floats, radius_m: float) -> Floats:
    """Return the lengths of the pieces of all six words.

    Parameters
    ----------
    starts, goals
        Poses, shape (n, 3): x [m], y [m], heading [rad].
    radius_m
        Turning radius [m].

    Returns
    -------
    Lengths [m], shape (6, 3, n), in the order of `WORDS`; NaN where a word does not reach the goal.
    """
    delta = (goals - starts).T
    cos, sin = np.cos(starts[:, 2]), np.sin(starts[:, 2])
    x = (cos * delta[0] + sin * delta[1]) / radius_m
    y = (-sin * delta[0] + cos * delta[1]) / radius_m
    heading = delta[2]
    words = [
        solve(x, side * y, side * heading)
        for solve in (_left_straight_left, _left_straight_right, _left_right_left)
        for side in (1.0, -1.0)
    ]
    return radius_m * np.stack(words)


def shortest_lengths(starts: Floats, goals: Floats, radius_m: float) -> Floats:
    """Return the lengths [m] of the shortest paths between `starts` and `goals` (n, 3), shape (n,)."""
    return cast(Floats, np.nanmin(word_lengths(starts, goals, radius_m).sum(axis=1), axis=0))


def shortest_path(start: Pose, goal: Pose, radius_m: float) -> tuple[Piece, ...]:
    """Return the shortest path from `start` to `goal`; pieces of no length are left out.

    Raises
    ------
    PlanError
        If the radius is not positive or a pose is not finite.

    Examples
    --------
    >>> path = shortest_path(Pose(0, 0, 0), Pose(0, 2, math.pi), 1.0)
    >>> [(piece.side, round(piece.length_m, 6)) for piece in path]
    [('left', 3.141593)]
    """
    require_solvable(start, goal, radius_m)
    lengths = word_lengths(np.array([start]), np.array([goal]), radius_m)[:, :, 0] / radius_m
    solved = zip(WORDS, lengths.tolist(), strict=True)
    paths = [path_of(word, pieces, radius_m) for word, pieces in solved if math.isfinite(sum(pieces))]
    return by_length(paths, radius_m)[0]


def shortest_path_backward(start: Pose, goal: Pose, radius_m: float) -> tuple[Piece, ...]:
    """Return the shortest path that is driven backward all the way.

    Backing up is driving forward in a vehicle that faces the other way, whose left is this one's right.
    """
    path = shortest_path(_facing_back(start), _facing_back(goal), radius_m)
    return tuple(piece.mirrored().reversed_gear() for piece in path)


def _facing_back(pose: Pose) -> Pose:
    return Pose(pose.x_m, pose.y_m, pose.heading_rad + math.pi)
