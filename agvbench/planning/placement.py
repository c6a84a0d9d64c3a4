"""Placement of a path on the floor: a start pose from which it stays inside the workspace."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from agvbench.errors import PlanError
from agvbench.planning.workspace import Workspace
from agvbench.types import Floats, Pose

_STRAIGHT_HEADINGS_DEG = (0, 90, 180, -90)
_HEADINGS_DEG = range(-180, 180, 15)
_NEARLY_M = 0.01


def best_start(points: Floats, workspace: Workspace) -> tuple[Pose, float]:
    """Return the start pose that keeps a path farthest from the edge, and that distance [m].

    Parameters
    ----------
    points
        Points that the vehicle passes, in the start frame, shape (n, 2).
    workspace
        The region to stay in.

    Notes
    -----
    For one heading, the largest distance is a linear programme in the start's x, y and the distance. Headings along
    and across the floor come first, because a vehicle is set down along a line more easily than askew; others, every
    15°, are tried only where none of these fits. Of equal headings the first is kept. Of the starts within a centimetre
    of the best, the most central is taken: in a long hall, the middle of it.
    """
    heading, distance = _best_heading(points, workspace, _STRAIGHT_HEADINGS_DEG)
    if distance < workspace.margin_m and not workspace.is_round:
        heading, distance = _best_heading(points, workspace, _HEADINGS_DEG)
    x, y = _most_central(points, heading, workspace, distance)
    return Pose(x, y, heading), distance


def _best_heading(points: Floats, workspace: Workspace, headings_deg: Iterable[int]) -> tuple[float, float]:
    best, distance = 0.0, -math.inf
    for heading in map(math.radians, headings_deg):
        found = _largest_distance(points, heading, workspace)
        if found > distance + 1e-6:
            best, distance = heading, found
        if workspace.is_round:
            break
    return best, distance


def _largest_distance(points: Floats, heading: float, workspace: Workspace) -> float:
    room = workspace.offsets - (Pose(0.0, 0.0, heading).place(points) @ workspace.normals.T).max(axis=0)
    # normals · start + distance <= room; the objective is the distance.
    constraints = np.column_stack([workspace.normals, np.ones(len(room))])
    return _solve(np.array([0.0, 0.0, -1.0]), constraints, room)[2]


def _most_central(points: Floats, heading: float, workspace: Workspace, distance: float) -> tuple[float, float]:
    """Return the start nearest to where the path's box is centred, among those not more than `_NEARLY_M` worse."""
    turned = Pose(0.0, 0.0, heading).place(points)
    room = workspace.offsets - (turned @ workspace.normals.T).max(axis=0) - (distance - _NEARLY_M)
    wanted = workspace.centre - 0.5 * (turned.max(axis=0) + turned.min(axis=0))
    # x, y and their distances from what is wanted, the sum of which is the objective.
    eye, none = np.eye(2), np.zeros((len(room), 2))
    constraints = np.block([[workspace.normals, none], [eye, -eye], [-eye, -eye]])
    x, y, *_ = _solve(np.array([0.0, 0.0, 1.0, 1.0]), constraints, np.concatenate([room, wanted, -wanted]))
    return x, y


def _solve(objective: Floats, constraints: Floats, limits: Floats) -> list[float]:
    from scipy.optimize import linprog

    solution = linprog(objective, A_ub=constraints, b_ub=limits, bounds=(None, None)).x
    # A bounded region that is not empty always has an answer: the distance may be negative.
    assert solution is not None  # noqa: S101
    return [float(value) for value in solution]


def check_fits(swept: Floats, start: Pose, workspace: Workspace, *, where: str) -> None:
    """Raise unless every point of a path that begins at `start` keeps the workspace's margin.

    Parameters
    ----------
    swept
        When and where the vehicle passes, in the start frame, shape (n, 3): t [s], x [m], y [m].

    Raises
    ------
    PlanError
        Saying when and where the path comes too close to the edge.
    """
    placed = start.place(swept[:, 1:])
    clearances = workspace.clearances(placed)
    if clearances.min() >= workspace.margin_m - 1e-6:
        return
    outside = np.flatnonzero(clearances < workspace.margin_m - 1e-6)
    first = outside[np.argmin(swept[outside, 0])]
    x, y = placed[first]
    raise PlanError(
        f"path leaves the workspace {workspace.name} after {swept[first, 0]:.1f} s at ({x:.2f}, {y:.2f}) m",
        where=where,
        value=f"at worst {_edge(clearances.min())}",
        limit=f"{workspace.margin_m:.2f} m inside",
        remedy="choose another start or a larger workspace",
    )


def does_not_fit(distance_m: float, workspace: Workspace, *, where: str) -> PlanError:
    """Return the error that a path fits nowhere in the workspace."""
    return PlanError(
        f"path does not fit into the workspace {workspace.name}",
        where=where,
        value=f"best placed, it comes to {_edge(distance_m)}",
        limit=f"{workspace.margin_m:.2f} m inside",
        remedy="shorten the trajectory or enlarge the workspace",
    )


def _edge(distance_m: float) -> str:
    return f"{abs(distance_m):.2f} m {'inside' if distance_m >= 0.0 else 'outside'} the edge"
