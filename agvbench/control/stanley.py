"""The Stanley controller: steer the front axle along the path, and towards it by its lateral distance.

References
----------
G. M. Hoffmann, C. J. Tomlin, M. Montemerlo, S. Thrun, Autonomous Automobile Trajectory Tracking for Off-Road Driving:
Controller Design, Experimental Validation and Racing, American Control Conference, 2007.
"""

from __future__ import annotations

import math

from agvbench.control.controller import ControlInput
from agvbench.control.follower import Approach, PathFollower, Tracking, require
from agvbench.control.motion import Motion
from agvbench.control.reference import Reference
from agvbench.types import Pose, wrap_angle

_DEFAULT_APPROACH = Approach()
_DEFAULT_LEVER_M = 0.3
_LARGEST_RAD = math.radians(60.0)


class Stanley:
    """Follows the path of a plan, forward and backward; a controller of one run.

    The guide point lies `lever_m` [m] before the reference point as the vehicle drives: with one steered axle in front
    and the default, the wheelbase, it is the front axle of the paper. It moves in the direction of its path's tangent,
    turned towards the path by arctan(``gain_per_s`` · e / (``softening_mps`` + speed)), where e [m] is its distance
    from the path. Driven backward, the guide point lies behind.

    Raises
    ------
    PlanError
        If the path cannot be followed; see `agvbench.control.sections_of`.
    FlagError
        If a parameter is out of range.
    """

    def __init__(
        self,
        reference: Reference,
        *,
        gain_per_s: float = 1.0,
        softening_mps: float = 0.1,
        lever_m: float | None = None,
        approach: Approach = _DEFAULT_APPROACH,
    ) -> None:
        geometry = reference.model.geometry
        usual_m = _DEFAULT_LEVER_M if geometry.is_differential else geometry.wheelbase_m
        self._lever_m = usual_m if lever_m is None else lever_m
        for name, value in {"gain_per_s": gain_per_s, "lever_m": self._lever_m}.items():
            require(0.0 < value < math.inf, name, value, "above 0")
        require(0.0 <= softening_mps < math.inf, "softening_mps", softening_mps, "from 0")
        self._gain, self._softening_mps = gain_per_s, softening_mps
        self._follower = PathFollower(reference, approach, self._lever_m)

    def __call__(self, seen: ControlInput) -> Motion | None:
        """Return the motion of the steering law; None at the end of the path."""
        tracking = self._follower.step(seen)
        if tracking is None:
            return None
        curvature = math.tan(self._steering_rad(tracking)) / self._lever_m
        return Motion(tracking.speed_mps, -curvature if tracking.section.backward else curvature)

    def _steering_rad(self, tracking: Tracking) -> float:
        """Return the direction of the guide point's motion [rad], from that in which the vehicle faces its motion."""
        path = tracking.section.at(tracking.s_m)
        left_m = Pose(*tracking.guide).relative_to(path).y_m
        speed = abs(tracking.section.speed_at(tracking.s_m)) + self._softening_mps
        wanted = wrap_angle(path.heading_rad - tracking.guide.heading_rad) - math.atan(self._gain * left_m / speed)
        return max(-_LARGEST_RAD, min(_LARGEST_RAD, wanted))
