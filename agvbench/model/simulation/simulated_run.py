"""What a simulation needs of one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import InputError
from agvbench.types import Commands, Floats


@dataclass(frozen=True)
class SimulatedRun:
    """What is to be simulated of one run.

    Parameters
    ----------
    commands
        Its commands, in the vehicle's unit.
    t_s
        Stamps of the frames to predict [s], ascending, on the commands' clock.
    started_h
        When it began, in hours since the session began.
    begins_s
        Stamp of the initial pose, for a window of free driving: commands before it only set the actuators in motion.
        None for a run from rest, where the vehicle stands at the initial pose until its first command takes effect.
    stood
        Front and rear command at which the axles had settled before the first command; by default neutral.
    """

    commands: Commands
    t_s: Floats
    started_h: float = 0.0
    begins_s: float | None = None
    preset: tuple[float, float] | None = None

    def before(self, neutral: float) -> dict[str, float]:
        """Return the command under which the vehicle stood before the first, by channel."""
        front, rear = self.preset or (neutral, neutral)
        return {"drive": neutral, "front": front, "rear": rear}


def check_runs(runs: Sequence[SimulatedRun]) -> None:
    """Raise an error if runs cannot be simulated.

    Raises
    ------
    InputError
        If there is no run, or a run has no command, or times that are not finite or go back.
    """
    if not runs:
        raise InputError("a simulation needs a run")
    for i, run in enumerate(runs):
        if len(run.commands) == 0:
            raise InputError("a run needs a command", where=f"run {i}", remedy="give at least one row")
        for what, times in (("commands.t_s", run.commands.t_s), ("t_s", run.t_s)):
            if not np.isfinite(times).all():
                raise InputError("is not finite", where=f"run {i}: {what}")
            if np.any(np.diff(times) < 0.0):
                raise InputError("time goes back", where=f"run {i}: {what}", remedy="sort by time")
