"""What runs and returns need of a link."""

from __future__ import annotations

from typing import Protocol

from agvbench.bus.keys import Keys
from agvbench.bus.messages.event import Event
from agvbench.bus.messages.identity import Identity
from agvbench.types import Command, Commands, Frames, Pose


class RunnerLink(Protocol):
    """A `VehicleLink`, or what stands before one; see there."""

    keys: Keys

    def identity(self) -> Identity:
        """Return who drives and who sees."""
        ...

    def reset(self, pose: Pose, *, run_key: str) -> None:
        """Place a simulated vehicle at rest."""
        ...

    def exchange(self, command: Command, *, t_s: float, hold_s: float) -> Frames:
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
