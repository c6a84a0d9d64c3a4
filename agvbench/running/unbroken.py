"""A simulation in lock step whose vehicle is placed once: after that, time goes on from run to run."""

from __future__ import annotations

import math
from dataclasses import replace

from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.event import Event
from agvbench.bus.messages.identity import Identity
from agvbench.types import Command, Commands, Frames, Pose

_SLACK_S = 1e-9
_ORIGIN = Pose(0.0, 0.0, 0.0)


class UnbrokenLink:
    """A link on which a run's clock may begin anew without a reset, as it may with a real vehicle.

    A simulator in lock step knows one clock since its last reset; here every exchange that goes back in time begins
    another, whose frames are told in it. Frames that were captured before it began have negative times.
    """

    def __init__(self, link: VehicleLink) -> None:
        self._link, self.keys = link, link.keys
        self._passed_s = self._offset_s = 0.0
        self._end_s = math.inf

    def identity(self) -> Identity:
        """Return who drives and who sees."""
        return self._link.identity()

    @property
    def passed_s(self) -> float:
        """The time that passed since the vehicle was placed [s]."""
        return self._passed_s

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place the vehicle at rest at `pose`."""
        self._link.reset(pose, run_key=run_key)
        self._passed_s, self._end_s = 0.0, math.inf

    def exchange(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Exchange as `VehicleLink.exchange` does."""
        if t_s < self._end_s - _SLACK_S:
            self._offset_s = self._passed_s - t_s
        self._end_s = t_s + hold_s
        frames = self._link.exchange(command, t_s=t_s + self._offset_s, hold_s=hold_s)
        self._passed_s = self._end_s + self._offset_s
        return self._told(frames)

    def flush(self) -> Frames:
        """Return the frames that were late."""
        return self._told(self._link.flush())

    def take_events(self) -> list[Event]:
        """Return what adapters and link reported since the last call."""
        return self._link.take_events()

    def stop(self) -> None:
        """Command neutral at once."""
        self._link.stop()

    def replay(self, run_key: str, commands: Commands, *, pose: Pose = _ORIGIN, until_s: float | None = None) -> None:
        """Let the vehicle drive a recorded run again; it has to be placed anew after it."""
        self._link.replay(run_key, commands, pose=pose, until_s=until_s)

    def _told(self, frames: Frames) -> Frames:
        return replace(frames, t_s=frames.t_s - self._offset_s, received_s=frames.received_s - self._offset_s)
