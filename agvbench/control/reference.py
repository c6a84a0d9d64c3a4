"""What a controller follows: the open-loop plan of a trajectory, and the model that makes commands of motions."""

from __future__ import annotations

import numpy as np

from agvbench.control.motion import Actuation, Motion
from agvbench.model import VehicleModel
from agvbench.planning import Plan
from agvbench.types import Command


class Reference:
    """The open-loop `plan` of a run, as feed-forward, and the `model` of the run's condition.

    Poses of ``plan.expected`` and ``plan.target`` are in the start frame, as those that a controller is given.
    """

    def __init__(self, plan: Plan, model: VehicleModel) -> None:
        self.plan, self.model = plan, model
        self.actuation = Actuation(model, plan.trajectory.steering)
        self._motions = [self.actuation.motion(plan.commands.at(row)) for row in range(len(plan.commands))]

    @property
    def ahead_m(self) -> float:
        """How far the reference point of motions lies ahead of the marker centroid [m]."""
        return self.actuation.ahead_m

    def planned(self, t_s: float) -> Command:
        """Return the plan's command at `t_s` [s] of the run's clock; after its end, the stop."""
        return self.plan.commands.at(self._row(t_s))

    def feed_forward(self, t_s: float) -> Motion:
        """Return the motion of `planned`, by the model's static maps."""
        return self._motions[self._row(t_s)]

    def _row(self, t_s: float) -> int:
        # A cycle that begins with a command must not miss it by a rounding error.
        return max(0, int(np.searchsorted(self.plan.commands.t_s, t_s + 1e-9, side="right")) - 1)
