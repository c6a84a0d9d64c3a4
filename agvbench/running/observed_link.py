"""A link whose last exchange can be seen from another thread."""

from __future__ import annotations

from typing import NamedTuple

from agvbench.bus.messages.event import Event
from agvbench.bus.messages.identity import Identity
from agvbench.running.links import RunnerLink
from agvbench.types import Command, Commands, Frames, Pose

_ORIGIN = Pose(0.0, 0.0, 0.0)


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


class ObservedLink:
    """Passes everything on to another link, and keeps its last exchange.

    A control cycle pays for one assignment, which is atomic: readers take what is there, without a lock.
    """

    def __init__(self, link: RunnerLink) -> None:
        self._link, self.keys = link, link.keys
        self.last: Exchange | None = None

    def identity(self) -> Identity:
        """Return the identities of vehicle and camera."""
        return self._link.identity()

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place a simulated vehicle at rest."""
        self._link.reset(pose, run_key=run_key)

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Exchange as `VehicleLink.control_cycle` does."""
        frames = self._link.control_cycle(command, t_s=t_s, hold_s=hold_s)
        self.last = Exchange(command, t_s + hold_s, frames)
        return frames

    def flush(self) -> Frames:
        """Return the frames that were late."""
        return self._link.flush()

    def take_events(self) -> list[Event]:
        """Return what adapters and link reported since the last call."""
        return self._link.take_events()

    def stop(self) -> None:
        """Command neutral at once."""
        self._link.stop()

    def replay(self, run_key: str, commands: Commands, *, pose: Pose = _ORIGIN, until_s: float | None = None) -> None:
        """Let a simulated vehicle drive a recorded run again."""
        self._link.replay(run_key, commands, pose=pose, until_s=until_s)
