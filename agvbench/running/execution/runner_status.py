"""What a bench does now: written by the thread that drives, read by the one that publishes it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Collection
from functools import cached_property

from msgspec.structs import replace

import agvbench
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.runner_state import MAX_ENTRIES, Phase, RunnerState, RunProgress, RunResult
from agvbench.errors import FitError, InputError
from agvbench.running.execution.run_records import RunRequest
from agvbench.running.observed_link import Exchange, ObservedLink
from agvbench.statistics import run_error
from agvbench.types import Run

_NO_RUN = RunProgress(0, 0, "", "", "", "", 0, 0, 0.0, 0.0)


class _Recorded:
    """A recorded run, whose error is computed when it is asked for."""

    def __init__(self, run: Run) -> None:
        self._run = run

    @cached_property
    def result(self) -> RunResult:
        """What the message says of it."""
        try:
            error = run_error(self._run)
        except (FitError, InputError):  # without target, or never seen at rest
            return RunResult(self._run.run_id, self._run.status)
        return RunResult(self._run.run_id, self._run.status, error.position_mm, error.heading_deg)


class RunnerStatus:
    """The state of a session that records the campaign `campaign`.

    The thread that drives replaces values as wholes, a few times per run, and never waits. Everything that takes time
    (the pose of the last exchange, the errors of the last runs) is computed in `state`, by the thread that calls it.
    """

    def __init__(self, campaign: str) -> None:
        self._campaign, self._began_unix_s, self._began_s = campaign, time.time(), time.monotonic()
        self._phase, self._run, self._numbers = Phase.STARTING, _NO_RUN, dict[str, int]()
        self._counted = self._rejected = self._fault_count = 0
        self._results, self._faults = deque[_Recorded](maxlen=MAX_ENTRIES), deque[str](maxlen=MAX_ENTRIES)
        self._failure: str | None = None
        self.link: ObservedLink | None = None
        """The link whose exchanges are shown, where there may be observers."""
        self._before: Exchange | None = None

    def expect(self, run_ids: Collection[str]) -> None:
        """Take note of the runs of the session, in the order in which they are driven."""
        self._numbers = {run_id: number for number, run_id in enumerate(run_ids, 1)}

    def enter(self, phase: Phase) -> None:
        """Take note of what is done from now on."""
        self._before = None if self.link is None else self.link.last
        self._phase = phase
        if phase is Phase.CALIBRATING:  # between two runs
            self._run = _NO_RUN

    def begin(self, request: RunRequest, attempt: int) -> None:
        """Take note of the run that is next."""
        number = self._numbers.get(request.run_id, 0)
        control = request.control
        duration_s = float(request.commands.t_s[-1]) if control is None else control.reference.plan.duration_s
        self._run = RunProgress(
            number, max(number, len(self._numbers)), request.run_id, request.experiment, request.trajectory,
            request.condition, request.repeat, attempt, 0.0, duration_s,
        )  # fmt: skip

    def end(self, run: Run) -> None:
        """Take note of a recorded run."""
        self._results.append(_Recorded(run))
        if run.is_ok:
            self._counted += 1
        else:
            self._rejected += 1
            self._add_fault(f"{run.run_id}: {run.status}")

    def report(self, event: Event) -> None:
        """Take note of an event of an adapter or of the link."""
        if event.level >= Level.WARNING:
            self._add_fault(f"{event.role} {event.kind}: {event.line}")

    def _add_fault(self, line: str) -> None:
        self._faults.append(line)
        self._fault_count += 1

    def finish(self, failure: str | None = None) -> None:
        """Take note that nothing more is driven, and what ended the session before its time, if anything did."""
        self._failure, self._phase = failure, Phase.FINISHED

    def state(self, sequence: int, source: int) -> RunnerState:
        """Return the state now, as the message with this number and source."""
        last = None if self.link is None else self.link.last
        phase, run = self._driven(last)
        return RunnerState(
            sequence, source, self._campaign, agvbench.__version__, phase, self._began_unix_s,
            max(0.0, time.monotonic() - self._began_s),
            run=run,
            pose=None if last is None else last.pose,
            command=None if last is None else last.command,
            counted=self._counted,
            rejected=self._rejected,
            faults=tuple(self._faults.copy()),
            fault_count=self._fault_count,
            results=tuple(run.result for run in self._results.copy()),
            failure=self._failure,
        )  # fmt: skip

    def _driven(self, last: Exchange | None) -> tuple[Phase, RunProgress | None]:
        """Return the phase and the run, with its clock after the exchange `last`."""
        phase, run = self._phase, self._run
        if run is _NO_RUN:
            return phase, None
        if phase is not Phase.DRIVING or last is None or last is self._before:  # an exchange of the run before
            return phase, run
        is_over = last.until_s > run.duration_s
        return Phase.SETTLING if is_over else phase, replace(run, t_s=last.until_s)
