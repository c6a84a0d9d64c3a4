"""What a controller is: called every control cycle, it says how the vehicle is to move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from agvbench.control.motion import Motion
from agvbench.control.reference import Reference
from agvbench.types import Command, Pose


@dataclass(frozen=True)
class ControlInput:
    """What a controller is given in a control cycle.

    Parameters
    ----------
    t_s
        The time [s] of the run's clock, 0 at its first command.
    pose
        The last tracked pose of the marker centroid, in the start frame: that of the pose measured at rest before the
        first command, as for the errors of the run. A single pose may be wrong; it is not filtered.
    pose_t_s
        When it was captured [s], on the run's clock.
    feed_forward
        The motion that the open-loop plan has at `t_s`; after its end, that of its stop.
    planned
        The command that the open-loop plan has at `t_s`, which also turns a differential vehicle on the spot.
    """

    t_s: float
    pose: Pose
    pose_t_s: float
    feed_forward: Motion
    planned: Command

    @property
    def age_s(self) -> float:
        """How long ago [s] the pose was captured."""
        return self.t_s - self.pose_t_s


Demand = Motion | Command | None
"""What a controller returns: a motion, a command in the vehicle's unit, or None to stop and end the run."""


class Controller(Protocol):
    """Drives one run; any callable of this form is one."""

    def __call__(self, seen: ControlInput, /) -> Demand:
        """Return what the vehicle is to do until the next call; None stops it and ends the run."""
        ...


ControllerFactory = Callable[[Reference], Controller]
"""Makes the controller of one run, which may have a state; a class whose constructor takes a `Reference` is one."""
