"""Commands of a run that a controller drives: it is called every control cycle, and its delay is measured."""

from __future__ import annotations

import math
import re
import time
import traceback
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agvbench.campaign.attempts import CONTROLLER_NEVER_ENDS
from agvbench.campaign.names import CONTROLLER
from agvbench.control import ControlInput, Controller, ControllerFactory, Demand, Motion, Reference
from agvbench.errors import AgvbenchError, ControllerError, FlagError
from agvbench.running.execution.drive import TimedCommand, as_commands
from agvbench.running.rest_detection import pose_before
from agvbench.types import Command, Commands, Frames, Pose

DEFAULT_PERIOD_S = 0.1
_NAME = re.compile(r"[A-Za-z0-9_.-]{0,60}")
_PERIODS_S = (0.02, 0.5)
"""A camera of 100 Hz sees two frames in the shortest; a vehicle's host stops it after the longest."""


@dataclass(frozen=True)
class Control:
    """What drives a run closed loop.

    Parameters
    ----------
    make_controller
        Called for each attempt at the run, before the vehicle moves.
    reference
        What the controller is to follow.
    period_s
        The control cycle [s].
    called
        How messages and the runs table call the controller; by default by the factory's name.

    Raises
    ------
    FlagError
        If the control cycle is out of range, or the name is not of letters, digits, ``_``, ``.`` and ``-``.
    """

    make_controller: ControllerFactory
    reference: Reference
    period_s: float = DEFAULT_PERIOD_S
    called: str = ""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.called):
            limit = "at most 60 letters, digits, _ . -"
            raise FlagError("name cannot be used", where="controller_name", value=self.called, limit=limit)
        low, high = _PERIODS_S
        if not low <= self.period_s <= high:
            value, limit = f"{self.period_s:g} s", f"{low:g} to {high:g} s"
            raise FlagError("control cycle cannot be used", where="period_s", value=value, limit=limit)

    @property
    def name(self) -> str:
        """How messages and the runs table call the controller: the name given, or ``"PurePursuit"`` of its factory."""
        if self.called:
            return self.called
        made: Any = getattr(self.make_controller, "func", self.make_controller)  # of functools.partial
        return re.sub(r"\W", "", str(getattr(made, "__name__", type(made).__name__)))

    @property
    def limit_s(self) -> float:
        """How long a run may last [s]: twice as long as open loop, and five seconds more."""
        return 2.0 * self.reference.plan.duration_s + 5.0

    def controller(self, run_id: str) -> Controller:
        """Return the controller of a run.

        Raises
        ------
        AgvbenchError
            What the factory says is wrong with the trajectory or a parameter.
        ControllerError
            If it fails otherwise.
        """
        try:
            return self.make_controller(self.reference)
        except AgvbenchError:
            raise
        except Exception as error:
            raise self.failed(run_id, error) from error

    def failed(self, run_id: str, error: Exception) -> ControllerError:
        """Return the line about an exception of factory or controller."""
        frame = traceback.extract_tb(error.__traceback__)[-1]
        value = f"{type(error).__name__}: {error} ({Path(frame.filename).name}:{frame.lineno})"
        return self._error(run_id, "controller failed", value)

    def unusable(self, run_id: str, demand: object) -> ControllerError:
        """Return the line about a demand that cannot be commanded."""
        limit = "a Motion or a Command of finite numbers, or None"
        return self._error(run_id, "controller returned what cannot be commanded", repr(demand)[:80], limit)

    def _error(self, run_id: str, what: str, value: str, limit: str | None = None) -> ControllerError:
        return ControllerError(what, where=f"{run_id}: {self.name}", value=value, limit=limit)


class ClosedLoop:
    """Drives one attempt at the run `run_id` by its controller.

    Parameters
    ----------
    control
        What drives.
    run_id
        What messages call the run.
    start
        Where it is to start (floor frame); the start frame is that of the pose that is measured at rest.
    lock_step
        Whether time stands still while the controller computes.

    Raises
    ------
    AgvbenchError
        As `Control.controller`.
    """

    def __init__(self, control: Control, run_id: str, start: Pose, *, lock_step: bool) -> None:
        self._control, self._run_id, self._start, self._lock_step = control, run_id, start, lock_step
        self._controller = control.controller(run_id)
        self._pose, self._pose_t_s, self._read = start, -math.inf, 0
        self._sent: list[TimedCommand] = []
        self._ages_s: list[float] = []
        self._compute_s: list[float] = []
        self.complaint = ""
        """Why the run does not count, whatever was seen of it: the controller did not end it in time."""

    def __call__(self, seen: list[Frames]) -> Iterator[TimedCommand]:
        """Yield a command every control cycle, and at last the stop; the source of commands of `drive`.

        Raises
        ------
        ControllerError
            If the controller raises an exception, or returns what cannot be commanded.
        """
        self._start = pose_before(Frames.concatenate(seen), 0.0) or self._start
        cycle, period_s = 0, self._control.period_s
        while True:
            t_s = cycle * period_s
            demand, took_s = self._demanded(t_s, seen) if t_s < self._control.limit_s else self._overtime()
            # The run's clock begins with the first command. A later one is sent as late as the controller took.
            sent_s = t_s + took_s if cycle else t_s
            if demand is None:
                yield self._send(TimedCommand(sent_s, self._stop(), 0.0))
                return
            if not cycle and took_s > period_s:
                # The vehicle stood while the controller computed its first answer.
                yield self._send(TimedCommand(0.0, self._stop(), took_s))
                sent_s = took_s
            self._ages_s.append(sent_s - self._pose_t_s)
            cycle += 1 + int(took_s / period_s)
            yield self._send(TimedCommand(sent_s, self._command(demand), cycle * period_s - sent_s))

    def _demanded(self, t_s: float, seen: list[Frames]) -> tuple[Demand, float]:
        """Call the controller; return what it demands, and for how long time went on meanwhile [s]."""
        self._look(seen)
        reference = self._control.reference
        pose = self._pose.relative_to(self._start)
        given = ControlInput(t_s, pose, self._pose_t_s, reference.feed_forward(t_s), reference.planned(t_s))
        began_s = time.perf_counter()
        try:
            demand = self._controller(given)
        except Exception as error:
            raise self._control.failed(self._run_id, error) from error
        took_s = time.perf_counter() - began_s
        self._compute_s.append(took_s)
        return demand, 0.0 if self._lock_step else took_s

    def _overtime(self) -> tuple[None, float]:
        limit_s = self._control.limit_s
        self.complaint = f"the controller {self._control.name} {CONTROLLER_NEVER_ENDS} (limit: {limit_s:.1f} s)"
        return None, 0.0

    def _look(self, seen: list[Frames]) -> None:
        """Take note of the last tracked pose among the frames that arrived since the last look."""
        for frames in seen[self._read :]:
            t_s = np.where(frames.tracked, frames.t_s, -math.inf)
            if len(t_s) and (newest := float(t_s.max())) > self._pose_t_s:
                i = int(t_s.argmax())
                pose = Pose(float(frames.x_m[i]), float(frames.y_m[i]), float(frames.heading_rad[i]))
                self._pose, self._pose_t_s = pose, newest
        self._read = len(seen)

    def _command(self, demand: object) -> Command:
        """Return the command for a demand; raise `ControllerError` if it is none."""
        actuation = self._control.reference.actuation
        with suppress(TypeError):  # numbers that are none
            if isinstance(demand, Motion) and demand.is_finite:
                return actuation.command(demand)
            if isinstance(demand, Command) and all(map(math.isfinite, demand)):
                return actuation.clipped(demand)
        raise self._control.unusable(self._run_id, demand)

    def _stop(self) -> Command:
        """Return the command that stops the vehicle after the last one, or after none."""
        model = self._control.reference.model
        last = self._sent[-1].command if self._sent else model.neutral
        return model.stop_after(last)

    def _send(self, timed: TimedCommand) -> TimedCommand:
        self._sent.append(timed)
        return timed

    @property
    def commands(self) -> Commands | None:
        """What was sent so far; None before the first command."""
        return as_commands(self._sent) if self._sent else None

    def columns(self) -> dict[str, object]:
        """Return what the runs table says of the controller; times [s] only where there are any."""
        columns: dict[str, object] = {CONTROLLER: self._control.name, "control_period_s": self._control.period_s}
        if self._ages_s:
            columns["controller_delay_s"] = float(np.median(self._ages_s))
        # Of a simulation in lock step, wall time would differ between campaigns of one seed.
        if self._compute_s and not self._lock_step:
            columns["controller_compute_s"] = float(np.max(self._compute_s))
        return columns
