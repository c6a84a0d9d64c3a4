"""Predicted end poses: where a vehicle model comes to rest, as the camera sees it, whatever effects it has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.model import VehicleModel
from agvbench.types import Commands, Floats, Pose, wrap_angle

REST_S = 4.0
"""How long after the stop the vehicle is taken to have coasted to rest [s]."""
_STEP_S = 0.02
_ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Departure:
    """When and where a run begins: what effects of the floor, the heading and the battery depend on.

    Parameters
    ----------
    start
        Start pose in the floor frame, as the camera sees it.
    started_h
        When the run begins, in hours since the session began.
    """

    start: Pose = _ORIGIN
    started_h: float = 0.0


@dataclass(frozen=True)
class EndPoseError:
    """Where a run ends against where it should, both in the start frame; signs as in the tables of end poses."""

    reached: Pose
    target: Pose

    @property
    def delta_s_m(self) -> float:
        """Distance driven minus distance to the target, both in a straight line [m]."""
        return math.hypot(*self.reached[:2]) - math.hypot(*self.target[:2])

    @property
    def delta_heading_rad(self) -> float:
        """Heading minus the target's [rad], wrapped."""
        return wrap_angle(self.reached.heading_rad - self.target.heading_rad)

    @property
    def along_m(self) -> float:
        """End position minus the target's, along the heading at the start [m]."""
        return self.reached.x_m - self.target.x_m

    @property
    def across_m(self) -> float:
        """The same, to the left [m]."""
        return self.reached.y_m - self.target.y_m

    @property
    def distance_m(self) -> float:
        """How far the end position is from the target [m]."""
        return math.hypot(self.along_m, self.across_m)


def rest_poses(model: VehicleModel, commands: Sequence[Commands], departure: Departure) -> Floats:
    """Return where the model comes to rest after each of `commands`, in the start frame, shape (n, 3).

    The heading is the change of heading, not wrapped.
    """
    times = [[float(c.t_s[-1]) + REST_S] for c in commands]
    return np.concatenate([path[-1:] for path in _paths(model, commands, times, departure)])


def coasting_path(model: VehicleModel, commands: Commands, departure: Departure) -> Floats:
    """Return the model's whole way to rest in the start frame, shape (n, 4): t [s], x [m], y [m], heading [rad]."""
    end_s = float(commands.t_s[-1]) + REST_S
    t_s = np.linspace(0.0, end_s, 2 + int(end_s / _STEP_S))
    return np.column_stack([t_s, _paths(model, [commands], [t_s], departure)[0]])


def _paths(
    model: VehicleModel, commands: Sequence[Commands], t_s: Sequence[Floats | list[float]], departure: Departure
) -> list[Floats]:
    start = departure.start
    count = len(commands)
    seen = model.rollout(commands, np.tile(start, (count, 1)), t_s, [departure.started_h] * count)
    c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return [(path - np.array(start)) @ turned for path in seen]
