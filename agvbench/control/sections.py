"""The sections of a plan's path: stretches between standstills, driven in one direction, with progress along them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from agvbench.control.reference import Reference
from agvbench.errors import PlanError
from agvbench.types import Floats, Pose

_STANDSTILL_MPS = 1e-3
_SHORTEST_M = 1e-3
_OFF_HEADING_RAD = math.radians(20.0)
"""Effects of a corrected plan turn the motion of the reference point by less, another steering mode by more."""
_TURNED_RAD = math.radians(0.5)


@dataclass(frozen=True)
class PathSection:
    """A stretch of the path of the guide point, a point on the vehicle's centre line.

    Parameters
    ----------
    backward
        Whether it is driven backward.
    rest_s
        For how long [s] the plan stands still before it.
    guide_m
        How far the guide point lies ahead of the marker centroid [m].
    points
        Its positions in the start frame, shape (n, 2) [m].
    s_m
        Arc length to them [m], shape (n,), from 0.
    speed_mps
        Planned speed of the reference point at them [m/s], shape (n,), signed.
    """

    backward: bool
    rest_s: float
    guide_m: float
    points: Floats
    s_m: Floats
    speed_mps: Floats

    @property
    def length_m(self) -> float:
        """Its length [m]."""
        return float(self.s_m[-1])

    def guide(self, pose: Pose) -> Pose:
        """Return where the guide point is [m] at `pose`, and in which direction the vehicle faces its motion [rad]."""
        x_m, y_m, _ = pose.compose(Pose(self.guide_m, 0.0, 0.0))
        return Pose(x_m, y_m, pose.heading_rad + math.pi * self.backward)

    def progress(self, point: Pose, near_m: float, within_m: float) -> float:
        """Return the arc length [m] of the nearest point of the path, not more than `within_m` from `near_m`.

        A path that crosses itself, as a figure eight does, has several near points; the search stays by the last one.
        """
        low_m, high_m = max(0.0, near_m - within_m), min(self.length_m, near_m + within_m)
        s_m = np.concatenate([[low_m], self.s_m[(self.s_m > low_m) & (self.s_m < high_m)], [high_m]])
        begin = np.column_stack([np.interp(s_m, self.s_m, column) for column in self.points.T])
        step, to_point = np.diff(begin, axis=0), np.array(point[:2]) - begin[:-1]
        squared = np.maximum((step**2).sum(axis=1), 1e-18)
        share = np.clip((to_point * step).sum(axis=1) / squared, 0.0, 1.0)
        nearest = int(np.argmin(((to_point - share[:, None] * step) ** 2).sum(axis=1)))
        return float(s_m[nearest] + share[nearest] * (s_m[nearest + 1] - s_m[nearest]))

    def speed_at(self, s_m: float) -> float:
        """Return the planned speed [m/s] at `s_m` [m]."""
        return float(np.interp(s_m, self.s_m, self.speed_mps))

    def at(self, s_m: float) -> Pose:
        """Return the point of the path at `s_m` [m] and its tangent [rad]; it is straight beyond its end."""
        last = len(self.s_m) - 1
        index = min(max(int(np.searchsorted(self.s_m, s_m, side="right")), 1), last)
        (x0, y0), (x1, y1) = self.points[index - 1].tolist(), self.points[index].tolist()
        share = (s_m - self.s_m[index - 1]) / (self.s_m[index] - self.s_m[index - 1])
        tangent = math.atan2(y1 - y0, x1 - x0)
        return Pose(float(x0 + share * (x1 - x0)), float(y0 + share * (y1 - y0)), tangent)


def sections_of(reference: Reference, lever_m: float = 0.0) -> list[PathSection]:
    """Return the sections of the plan's path, for a guide point `lever_m` [m] before the reference point as it drives.

    Raises
    ------
    PlanError
        If the vehicle turns on the spot or moves across its heading, which no curvature does; or if nothing is driven.
    """
    where, path = reference.plan.trajectory.name, reference.plan.expected
    points = _ahead(path, reference.ahead_m)
    step = np.diff(points, axis=0)
    middle = 0.5 * (path[:-1, 3] + path[1:, 3])
    along = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
    across = step[:, 1] * np.cos(middle) - step[:, 0] * np.sin(middle)
    moves = np.abs(along) + np.abs(across) > _STANDSTILL_MPS * np.diff(path[:, 0])
    _check_follows_heading(along[moves], across[moves], np.diff(path[:, 3])[~moves], where=where)
    sections, rest_s = [], 0.0
    for first, last, sense in _stretches(np.where(moves, np.sign(along), 0.0)):
        rows = path[first : last + 1]
        section = _section(reference, rows, sense, rest_s, lever_m) if sense else None
        rest_s = 0.0 if section is not None else rest_s + float(rows[-1, 0] - rows[0, 0])
        sections += [] if section is None else [section]
    if not sections:
        raise PlanError("nothing is driven along a path", where=where)
    return sections


def _check_follows_heading(along: Floats, across: Floats, turned_at_rest: Floats, *, where: str) -> None:
    remedy = "drive it open loop, or with a controller that returns commands"
    if len(along) and float(np.abs(np.arctan2(across, np.abs(along))).max()) > _OFF_HEADING_RAD:
        raise PlanError("a path across the heading cannot be followed", where=where, remedy=remedy)
    if float(np.abs(turned_at_rest).sum()) > _TURNED_RAD:
        raise PlanError("a turn on the spot cannot be followed", where=where, remedy=remedy)


def _stretches(sense: Floats) -> list[tuple[int, int, float]]:
    """Return first row, last row and sense of each stretch of steps (n,) with one sense."""
    ends = [0, *(np.flatnonzero(np.diff(sense)) + 1).tolist(), len(sense)]
    return [(a, b, float(sense[a])) for a, b in pairwise(ends) if b > a]


def _section(reference: Reference, rows: Floats, sense: float, rest_s: float, lever_m: float) -> PathSection | None:
    """Return the section of `rows` of the path; None where it is too short or nothing drives in its sense."""
    guide_m = reference.ahead_m + sense * lever_m
    points = _ahead(rows, guide_m)
    s_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    kept = np.concatenate([[True], np.diff(s_m) > 1e-9])
    planned = np.array([reference.feed_forward(t_s).speed_mps for t_s in rows[kept, 0].tolist()])
    driven = np.sign(planned) == sense
    if s_m[-1] < _SHORTEST_M or not driven.any():
        return None
    # Where the plan coasts, it continues at the speed that it was driven with.
    speed = np.interp(s_m[kept], s_m[kept][driven], planned[driven])
    return PathSection(sense < 0.0, rest_s, guide_m, points[kept], s_m[kept], speed)


def _ahead(path: Floats, distance_m: float) -> Floats:
    """Return the positions (n, 2) [m] of a point on the centre line, on a path (n, 4) of the marker centroid."""
    return path[:, 1:3] + distance_m * np.column_stack([np.cos(path[:, 3]), np.sin(path[:, 3])])
