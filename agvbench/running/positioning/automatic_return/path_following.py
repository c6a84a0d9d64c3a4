"""Path following: which curvature keeps a vehicle to its path.

With y the distance to the left of the path, e the course's error and d the gear (±1), travel along the path gives
y' = d sin e and e' = d (κ − κ_path). The law κ = κ_path − y/ℓ² − (2/ℓ) d sin e makes y'' + (2/ℓ) y' + y/ℓ² = 0:
errors die off over the length ℓ without overshoot, whichever way the vehicle drives.

References
----------
C. Samson, "Control of chained systems: application to path following and time-varying point-stabilization of mobile
robots", IEEE Transactions on Automatic Control 40 (1995), 64-77.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agvbench.planning.shortest_paths.return_path import STEP_M, GearLeg
from agvbench.types import Pose, wrap_angle

_AHEAD_M = 0.3
_LARGEST_OFFSET = 0.7
"""Of ℓ: an offset beyond counts as this, so that a vehicle far off meets its path at some 45° at most."""


@dataclass(frozen=True)
class Guidance:
    """Where a vehicle is on its path: what is left of it, how far left of it [m], and the curvature to drive [1/m]."""

    left_m: float
    offset_m: float
    curvature_per_m: float


class Follower:
    """Follows one leg; `goal_crab_rad` is the crab angle for which its end was planned, if it ends at the goal."""

    def __init__(self, leg: GearLeg, length_m: float, *, goal_crab_rad: float | None = None) -> None:
        self._leg, self._length_m, self._planned = leg, length_m, goal_crab_rad
        self._index = 0

    def guide(self, at: Pose, crab_rad: float) -> Guidance:
        """Return the guidance for a guided point at `at`, course included, of a vehicle that crabs at `crab_rad`."""
        if self._planned is not None:
            at = self._as_planned(at, crab_rad - self._planned)
        points, sign = self._leg.points, -1.0 if self._leg.backward else 1.0
        window = points[self._index : self._index + round(_AHEAD_M / STEP_M)]
        self._index += int(((window[:, 0] - at.x_m) ** 2 + (window[:, 1] - at.y_m) ** 2).argmin())
        x, y, course = points[self._index].tolist()
        c, s = math.cos(course), math.sin(course)
        along = sign * (c * (at.x_m - x) + s * (at.y_m - y))
        offset = c * (at.y_m - y) - s * (at.x_m - x)
        error = wrap_angle(at.heading_rad - course)
        left = self._leg.length_m - float(self._leg.along_m[self._index]) - along
        return Guidance(left, offset, self._curvature(offset, error, sign))

    def _curvature(self, offset_m: float, error_rad: float, sign: float) -> float:
        length = self._length_m
        bounded = min(_LARGEST_OFFSET * length, max(-_LARGEST_OFFSET * length, offset_m))
        path = float(self._leg.curvature_per_m[self._index])
        return path - bounded / length**2 - 2.0 * sign * math.sin(error_rad) / length

    def _as_planned(self, at: Pose, turned_rad: float) -> Pose:
        """Turn about the goal by what was learned of the crab angle since the leg was planned.

        A vehicle that crabs comes to its goal with the right heading on a line that is turned by the crab angle.
        """
        x, y, _ = self._leg.points[-1].tolist()
        c, s = math.cos(turned_rad), -math.sin(turned_rad)
        dx, dy = at.x_m - x, at.y_m - y
        return Pose(x + c * dx - s * dy, y + s * dx + c * dy, at.heading_rad - turned_rad)
