"""A link whose last exchange can be seen from another thread."""

from __future__ import annotations

from typing import NamedTuple

from agvbench.running.links import ForwardingLink, RunnerLink
from agvbench.types import Command, Frames, Pose


class Exchange(NamedTuple):
    """A command, until when it held [s, the run's clock], and the frames that arrived meanwhile."""

    command: Command
    until_s: float
    frames: Frames

    @property
    def pose(self) -> Pose | None:
        """The last tracked pose; None where the vehicle was not tracked."""
        tracked = self.frames.tracked.nonzero()[0]
        if not len(tracked):
            return None
        i = tracked[-1]
        pose = Pose(float(self.frames.x_m[i]), float(self.frames.y_m[i]), float(self.frames.heading_rad[i]))
        return pose if pose.is_finite else None


class ObservedLink(ForwardingLink):
    """Keeps the last exchange of another link.

    A control cycle pays for one assignment, which is atomic: readers take what is there, without a lock.
    """

    def __init__(self, link: RunnerLink) -> None:
        super().__init__(link)
        self.last: Exchange | None = None

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Exchange as `VehicleLink.control_cycle` does."""
        frames = super().control_cycle(command, t_s=t_s, hold_s=hold_s)
        self.last = Exchange(command, t_s + hold_s, frames)
        return frames
