"""The error of one run: end position error, heading error, Δs and Δδ, with standard errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from agvbench.statistics.rest import RestPose
from agvbench.types import Pose, wrap_angle


@dataclass(frozen=True)
class PoseError:
    """Where a run ended against where it should have ended; m and rad.

    ``position_m`` is the distance of the end position from the target's, ``along_m`` and ``across_m`` are its
    components along x and y of the start frame. ``delta_s_m`` is ``|end − start| − target distance``, which cannot see
    sideways drift, and ``delta_heading_rad`` the heading change minus the target's, wrapped; both are signed (the
    thesis, section 8.2, reports them without sign). ``end`` is the end pose in the start frame. Standard errors come
    from the frames at rest and say nothing about the scatter between runs.
    """

    end: Pose
    delta_s_m: float
    delta_heading_rad: float
    along_m: float
    across_m: float
    stderr_position_m: float
    stderr_heading_rad: float

    @property
    def position_m(self) -> float:
        """Return the end position error [m]."""
        return math.hypot(self.along_m, self.across_m)


def pose_error(start: RestPose, end: RestPose, target: Pose) -> PoseError:
    """Return the error of a run from `start` to `end` (floor frame) against `target` (start frame).

    >>> still = dict(stderr_x_m=0.0, stderr_y_m=0.0, stderr_heading_rad=0.0, frames=1, left_out=0)
    >>> error = pose_error(RestPose(Pose(1, 1, math.pi / 2), **still), RestPose(Pose(1, 3.01, math.pi / 2), **still),
    ...                    Pose(2.0, 0.0, 0.0))
    >>> round(error.delta_s_m, 6), round(error.along_m, 6), round(error.across_m, 6)
    (0.01, 0.01, 0.0)
    """
    reached = end.pose.relative_to(start.pose)
    return PoseError(
        end=reached,
        delta_s_m=math.hypot(reached.x_m, reached.y_m) - math.hypot(target.x_m, target.y_m),
        delta_heading_rad=wrap_angle(reached.heading_rad - target.heading_rad),
        along_m=reached.x_m - target.x_m,
        across_m=reached.y_m - target.y_m,
        stderr_position_m=math.hypot(_position_stderr(start), _position_stderr(end)),
        stderr_heading_rad=math.hypot(start.stderr_heading_rad, end.stderr_heading_rad),
    )


def _position_stderr(rest: RestPose) -> float:
    """Return the standard error [m] of a position along any one direction."""
    return math.hypot(rest.stderr_x_m, rest.stderr_y_m) / math.sqrt(2.0)
