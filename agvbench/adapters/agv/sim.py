"""``sim``: a simulated vehicle. It hosts the plant, and time passes in it only while a command is exchanged."""

from __future__ import annotations

import math

import numpy as np

from agvbench.adapters.contract import NO_POSES, AdapterOptions
from agvbench.adapters.simulated_agv import SimulatedAgv
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.request import Replay, Reset, Sampling
from agvbench.bus.messages.truth import TruthFlags
from agvbench.errors import LinkError
from agvbench.types import Command, Floats, Plant

_SLACK_S = 1e-9
_NO_TIMES = np.empty(0)


class SimAgv(SimulatedAgv):
    """A plant behind the bus, in lock step.

    The plant is advanced to the instants at which the camera looks and to those at which the command changes, no
    others: how a runner cuts a hold into exchanges makes no difference to what the plant does.
    """

    scheme = "sim"
    lock_step = True

    def __init__(self, plant: Plant, options: AdapterOptions) -> None:
        super().__init__(plant, options)
        # Where the plant is (`_plant_s`) and will be, in the run's clock; NaN until the first command.
        self._end_s = math.nan
        self._next_frame = 0

    def reset(self, request: Reset) -> None:
        """Place the plant at rest."""
        super().reset(request)
        self._plant_s = self._end_s = math.nan

    def apply(self, message: CommandMessage) -> None:
        """Let the command's interval pass, and show the camera its poses."""
        if message.flags & CommandFlags.FLUSH:
            flags = TruthFlags.LAST | TruthFlags.FLUSH
            end_s = 0.0 if math.isnan(self._end_s) else self._end_s
            return self._reports.truth(_NO_TIMES, NO_POSES, end_s=end_s, acknowledged=message.sequence, flags=flags)
        t_s, poses = self._drive(message.command, message.t_s, message.t_s + message.hold_s)
        return self._reports.truth(t_s, poses, end_s=self._end_s, acknowledged=message.sequence)

    def replay(self, request: Replay) -> None:
        """Drive a recorded run again."""
        self.reset(request.reset)
        times = request.commands.t_s
        ends = np.append(times, request.until_s)[1:]
        for index, (start_s, end_s) in enumerate(zip(times.tolist(), ends.tolist(), strict=True)):
            self._drive(request.commands.at(index), start_s, max(start_s, end_s))

    def stop(self) -> None:
        """Do nothing: no time passes unless a command is exchanged, and the next one brings its own."""

    def close(self) -> None:
        """Nothing to release."""

    def _drive(self, command: Command, start_s: float, end_s: float) -> tuple[Floats, Floats]:
        """Return the camera's instants in [start, end) and the true poses then."""
        sampling = self._sampling
        if sampling is None:
            raise LinkError("vehicle was not placed before its first command", where=self.scheme, remedy="reset it")
        if math.isnan(self._end_s):
            self._plant_s = self._end_s = start_s
            self._next_frame = math.ceil((start_s - sampling.phase_s) * sampling.rate_hz)
        if start_s < self._end_s - _SLACK_S:
            raise LinkError("time goes back", where="command", value=f"{start_s} s", limit=f"from {self._end_s} s")
        if start_s > self._end_s + _SLACK_S:
            raise LinkError("time leaps ahead", where="command", value=f"{start_s} s", limit=f"{self._end_s} s")
        self._hold(command, start_s)
        self._end_s = end_s
        return self._advance_through(self._instants(sampling, end_s))

    def _hold(self, command: Command, from_s: float) -> None:
        """Change the command at `from_s`: until then the old one held. Where a wheel saturates, both slow down."""
        command = self._options.channels.limited(command)
        if command != self._held:
            if from_s - self._plant_s > _SLACK_S:
                self._plant.advance(*self._held, from_s - self._plant_s)
                self._plant_s = from_s
            self._held = command

    def _instants(self, sampling: Sampling, end_s: float) -> Floats:
        stop = math.ceil((end_s - _SLACK_S - sampling.phase_s) * sampling.rate_hz)
        numbers = np.arange(self._next_frame, max(stop, self._next_frame))
        self._next_frame += len(numbers)
        instants: Floats = sampling.phase_s + numbers / sampling.rate_hz
        return instants

    def _advance_through(self, instants: Floats) -> tuple[Floats, Floats]:
        advance, command, at_s = self._plant.advance, self._held, self._plant_s
        poses = []
        for instant in instants.tolist():
            poses.append(advance(*command, max(0.0, instant - at_s)))
            at_s = instant
        self._plant_s = at_s
        return instants, np.array(poses, dtype=np.float64).reshape(-1, 3)
