"""Pure pursuit: drive the arc that leads to a point of the path ahead.

References
----------
R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, Carnegie Mellon University,
1992.
"""

from __future__ import annotations

import math

from agvbench.control.controller import ControlInput
from agvbench.control.follower import Approach, PathFollower, require
from agvbench.control.motion import Motion
from agvbench.control.reference import Reference
from agvbench.types import Pose

_DEFAULT_APPROACH = Approach()


class PurePursuit:
    """Follows the path of a plan, forward and backward; a controller of one run.

    The reference point drives an arc that is tangent to the heading and leads to the goal, the point of the path
    `lookahead_m` [m] of arc length beyond the nearest one. A larger distance is calmer and cuts corners.

    Raises
    ------
    PlanError
        If the path cannot be followed; see `agvbench.control.sections_of`.
    FlagError
        If a parameter is out of range.
    """

    def __init__(
        self, reference: Reference, *, lookahead_m: float = 0.3, approach: Approach = _DEFAULT_APPROACH
    ) -> None:
        require(0.0 < lookahead_m < math.inf, "lookahead_m", lookahead_m, "above 0")
        self._follower, self._lookahead_m = PathFollower(reference, approach), lookahead_m

    def __call__(self, seen: ControlInput) -> Motion | None:
        """Return the motion towards the goal; None at the end of the path."""
        tracking = self._follower.step(seen)
        if tracking is None:
            return None
        goal = tracking.section.at(tracking.s_m + self._lookahead_m)
        curvature = arc_curvature(goal.relative_to(tracking.guide))
        return Motion(tracking.speed_mps, -curvature if tracking.section.backward else curvature)


def arc_curvature(goal: Pose) -> float:
    """Return the curvature [1/m] of the arc from the origin, tangent to the x axis, through the place of `goal`.

    >>> arc_curvature(Pose(1.0, 1.0, 0.0))  # a quarter of a circle of radius 1 m
    1.0
    """
    squared = goal.x_m**2 + goal.y_m**2
    return 2.0 * goal.y_m / squared if squared else 0.0
