"""Commands out under the supervisor's eyes, and what was seen meanwhile: the clock of one return."""

from __future__ import annotations

from agvbench.running.links import RunnerLink
from agvbench.running.returning.sight import Sight, Step
from agvbench.running.supervision import Supervisor
from agvbench.types import Command, Frames


class Reins:
    """Holds commands one after another on the clock of a return, which begins at 0."""

    def __init__(self, link: RunnerLink, supervisor: Supervisor) -> None:
        self._link, self._supervisor = link, supervisor
        self.where = link.keys.root
        self.sight, self.now_s = Sight(), 0.0
        self.step: Step | None = None

    def begin(self) -> None:
        """Let the supervisor begin anew: the vehicle stands."""
        self._supervisor.begin()

    def hold(self, command: Command, hold_s: float) -> Frames:
        """Hold `command` for `hold_s` [s]; return the frames that arrived, which ``sight`` and ``step`` have seen.

        Raises
        ------
        SafetyStopError
            If the supervisor stopped the vehicle.
        LinkError
            As from the link.
        """
        seen: list[Frames] = []
        self._supervisor.exchange(self._link, command, t_s=self.now_s, hold_s=hold_s, seen=seen)
        self.now_s += hold_s
        frames = Frames.concatenate(seen)
        self.step = self.sight.see(frames, self.now_s)
        return frames
