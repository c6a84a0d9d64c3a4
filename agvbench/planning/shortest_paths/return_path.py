"""The path back to a start: Reeds–Shepp to a line that leads straight into it, inside the workspace.

Small errors of a pose take manoeuvres of many pieces to remove exactly, and each piece makes errors of its own. So the
last stretch is always a straight along which a controller has room to remove them: the path leads to its far end.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import PlanError
from agvbench.planning.shortest_paths.pieces import Piece, length_of
from agvbench.planning.shortest_paths.reeds_shepp import paths_by_length
from agvbench.planning.workspace import Workspace
from agvbench.types import Floats, Pose
from agvbench.vehicle.geometry import Geometry

STEP_M = 0.005
_CUSP_M = 0.5
"""What a change of gear costs, as a way that takes as long [m]."""
_CHECK_M = 0.02


@dataclass(frozen=True)
class GearLeg:
    """A stretch of a way that is driven in one gear.

    Parameters
    ----------
    points
        Pose of the guided point along it, course unwrapped, shape (n, 3) [m, m, rad].
    along_m
        How far along the leg they are [m], from 0, shape (n,).
    curvature_per_m
        Left turns positive, whichever way it is driven, shape (n,).
    backward
        Whether it is driven backward.
    """

    points: Floats
    along_m: Floats
    curvature_per_m: Floats
    backward: bool

    @property
    def length_m(self) -> float:
        """Length [m]."""
        return float(self.along_m[-1])


@dataclass(frozen=True)
class Guided:
    """The point of the vehicle that keeps to a path: `forward_m` of the marker centroid, where nothing slips laterally.

    Its course is the vehicle's heading plus `crab_rad`, at which the vehicle is seen to move.
    """

    geometry: Geometry
    forward_m: float = 0.0
    crab_rad: float = 0.0

    def pose(self, seen: Pose) -> Pose:
        """Return place and course of the guided point of a vehicle that is seen at `seen`.

        >>> Guided(Geometry(0.2, 0.1), forward_m=-0.1).pose(Pose(1.0, 2.0, 0.0))
        Pose(x_m=0.9, y_m=2.0, heading_rad=0.0)
        """
        x_m, y_m, heading_rad = seen
        ahead = (self.forward_m * math.cos(heading_rad), self.forward_m * math.sin(heading_rad))
        return Pose(x_m + ahead[0], y_m + ahead[1], heading_rad + self.crab_rad)

    def clearance_m(self, points: Floats, workspace: Workspace) -> float:
        """Return how far inside the edge the axles' centres stay [m] while the guided point passes `points` (n, 3)."""
        heading = points[:, 2] - self.crab_rad
        along = np.column_stack([np.cos(heading), np.sin(heading)])
        ends = (self.geometry.front_axle_m - self.forward_m, -self.geometry.rear_axle_m - self.forward_m)
        axles = np.concatenate([points[:, :2] + end * along for end in ends])
        return float(workspace.clearances(axles).min())


def plan_return_path(
    seen: Pose,
    start: Pose,
    guided: Guided,
    workspace: Workspace,
    *,
    radii_m: Sequence[float],
    leads_m: Sequence[float],
    gears: Sequence[bool] = (False, True),
) -> list[GearLeg]:
    """Return the legs of the quickest way from `seen` to `start` (floor frame); the last ends with a straight.

    Parameters
    ----------
    radii_m
        Radii to turn at, tightest last: the first with which any way fits is taken.
    leads_m
        Lengths of the straight, longest first: likewise.
    gears
        Whether to come backward, forward, or as is quicker.

    Raises
    ------
    PlanError
        If no way stays inside the workspace.
    """
    here, there = guided.pose(seen), guided.pose(start)
    ends = [guided.clearance_m(np.array([pose]), workspace) for pose in (here, there)]
    limit_m = min(workspace.margin_m, *ends)
    if limit_m < 0.0:
        raise _no_return_path(workspace, f"the vehicle stands {-limit_m:.2f} m outside")
    for lead_m in leads_m:
        for radius_m in radii_m:
            for pieces in _by_cost(here, there, radius_m, lead_m, gears):
                path = _leg(pieces, here, _CHECK_M, backward=False).points
                if guided.clearance_m(path, workspace) >= limit_m - 1e-6:
                    return _legs(pieces, here)
    raise _no_return_path(workspace, "every way comes too close to the edge")


def _no_return_path(workspace: Workspace, value: str) -> PlanError:
    return PlanError(
        "the vehicle cannot drive back to its start", where=f"workspace {workspace.name}", value=value,
        limit=f"{workspace.margin_m:.2f} m inside", remedy="put it there by hand",
    )  # fmt: skip


def _by_cost(here: Pose, there: Pose, radius_m: float, lead_m: float, gears: Sequence[bool]) -> list[list[Piece]]:
    ways = []
    for backward in gears:
        lead = Piece("straight", lead_m, backward=backward)
        begin = lead.reversed_gear().end(there)
        ways += [[*pieces, lead] for pieces in paths_by_length(here, begin, radius_m)]
    return sorted(ways, key=_cost)


def _cost(pieces: Sequence[Piece]) -> float:
    cusps = sum(before.backward != after.backward for before, after in itertools.pairwise(pieces))
    return length_of(pieces) + _CUSP_M * cusps


def _legs(pieces: Sequence[Piece], here: Pose) -> list[GearLeg]:
    legs = []
    for backward, gear in itertools.groupby(pieces, key=lambda piece: piece.backward):
        leg = _leg(list(gear), here, STEP_M, backward=backward)
        legs.append(leg)
        here = Pose(*leg.points[-1].tolist())
    return legs


def _leg(pieces: Sequence[Piece], here: Pose, step_m: float, *, backward: bool) -> GearLeg:
    """Return a leg with a point every `step_m` or so; the last is its end, and the course does not jump."""
    points, distances, curvatures = [np.array([here])], [np.zeros(1)], []
    for piece in pieces:
        sign = -1.0 if piece.backward else 1.0
        on = np.linspace(0.0, piece.length_m, max(1, round(piece.length_m / step_m)) + 1)[1:]
        curvature = sign * piece.turn_rad / piece.length_m
        x, y, course = points[-1][-1].tolist()
        half = 0.5 * sign * curvature * on
        chord = sign * on * np.sinc(half / math.pi)
        columns = (x + chord * np.cos(course + half), y + chord * np.sin(course + half), course + 2.0 * half)
        points.append(np.column_stack(columns))
        distances.append(distances[-1][-1] + on)
        curvatures += [curvature] * len(on)
    bends = np.array([*curvatures, curvatures[-1]])
    return GearLeg(np.concatenate(points), np.concatenate(distances), bends, backward)
