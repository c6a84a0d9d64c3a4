"""Links to vehicle and camera: what runs and returns need of one, and a simulated one that is never reset."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from agvbench.bus.keys import Keys
from agvbench.bus.messages.event import Event
from agvbench.bus.messages.identity import Identity
from agvbench.types import Command, Commands, Frames, Pose


class RunnerLink(Protocol):
    """A `VehicleLink`, or what stands before one; see there."""

    keys: Keys

    def identity(self) -> Identity:
        """Return the identities of vehicle and camera."""
        ...

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place a simulated vehicle at rest."""
        ...

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Publish a command; return the frames that arrive while it holds. Where `t_s` goes back, a clock begins."""
        ...

    def flush(self) -> Frames:
        """Return the frames that were late."""
        ...

    def take_events(self) -> list[Event]:
        """Return what adapters and link reported since the last call."""
        ...

    def stop(self) -> None:
        """Command neutral at once."""
        ...

    def replay(self, run_key: str, commands: Commands, *, pose: Pose = ..., until_s: float | None = None) -> None:
        """Let a simulated vehicle drive a recorded run again."""
        ...


_SLACK_S = 1e-9
_ORIGIN = Pose(0.0, 0.0, 0.0)


class ForwardingLink:
    """Passes everything on to another link: the base of links that change or watch a part of what they pass."""

    def __init__(self, link: RunnerLink) -> None:
        self._link, self.keys = link, link.keys

    def identity(self) -> Identity:
        """Return the identities of vehicle and camera."""
        return self._link.identity()

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place a simulated vehicle at rest at `pose`."""
        self._link.reset(pose, run_key=run_key)

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Exchange as `VehicleLink.control_cycle` does."""
        return self._link.control_cycle(command, t_s=t_s, hold_s=hold_s)

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
        """Let a simulated vehicle drive a recorded run again; it has to be placed anew after it."""
        self._link.replay(run_key, commands, pose=pose, until_s=until_s)


class ContinuousLink(ForwardingLink):
    """A link on which a run's clock may begin anew without a reset, as it may with a real vehicle.

    A simulator in lock step knows one clock since its last reset; here every exchange that goes back in time begins
    another, in which its frames are timed. Frames that were captured before it began have negative times.
    """

    def __init__(self, link: RunnerLink) -> None:
        super().__init__(link)
        self._passed_s = self._offset_s = 0.0
        self._end_s = math.inf

    @property
    def passed_s(self) -> float:
        """The time that passed since the vehicle was placed [s]."""
        return self._passed_s

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place the vehicle at rest at `pose`."""
        super().reset(pose, run_key=run_key)
        self._passed_s, self._end_s = 0.0, math.inf

    def control_cycle(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
        """Exchange as `VehicleLink.control_cycle` does."""
        if t_s < self._end_s - _SLACK_S:
            self._offset_s = self._passed_s - t_s
        self._end_s = t_s + hold_s
        frames = super().control_cycle(command, t_s=t_s + self._offset_s, hold_s=hold_s)
        self._passed_s = self._end_s + self._offset_s
        return self._on_run_clock(frames)

    def flush(self) -> Frames:
        """Return the frames that were late."""
        return self._on_run_clock(super().flush())

    def _on_run_clock(self, frames: Frames) -> Frames:
        return replace(frames, t_s=frames.t_s - self._offset_s, received_s=frames.received_s - self._offset_s)
