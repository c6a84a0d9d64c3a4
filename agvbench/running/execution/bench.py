"""The bench drives a session's runs: each is judged, recorded, and repeated where it was rejected."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import replace

from agvbench.bus.messages.event import Event
from agvbench.bus.messages.runner_state import Phase
from agvbench.campaign import CampaignWriter
from agvbench.errors import (
    CampaignError,
    ControllerError,
    FlagError,
    RunStoppedError,
    SafetyStopError,
)
from agvbench.model import VehicleModel
from agvbench.planning import Departure, Workspace
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.execution.calibration import unfinished_calibration
from agvbench.running.execution.campaign_time import CampaignTime, SessionBegan
from agvbench.running.execution.closed_loop import ClosedLoop
from agvbench.running.execution.drive import DEFAULT_TIMING, Drive, Timing, control_cycles_of, drive
from agvbench.running.execution.event_log import EventLog
from agvbench.running.execution.latch import Failure, Latch
from agvbench.running.execution.pause import PauseRequest, holding_neutral
from agvbench.running.execution.run_records import (
    RunRequest,
    as_sent,
    attempts_by_run,
    record_aborted,
    recorded_run,
    stopped_drive,
    times_stopped,
)
from agvbench.running.execution.runner_status import RunnerStatus
from agvbench.running.links import RunnerLink
from agvbench.running.positioning.placers import Rig, make_placer
from agvbench.running.positioning.start_pose import notify_operator
from agvbench.running.quality import DEFAULT_LIMITS, QualityLimits, assess, not_as_planned
from agvbench.running.supervision.limits import DEFAULT_SAFETY
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Frames, Outcome, Run, RunStatus

_UNNAMED = SessionBegan()
_MOST_UNSEEN = 3
"""Runs in which the vehicle is not seen at all, one after another: then the camera needs the operator."""


class Bench:
    """Drives orders over `link` and records them with `writer`.

    ``calibrate`` is called once, with the calibration runs that are still `awaited`, when the first order asks for the
    calibrated model; ``corrected`` is the model of the
    condition of that name, if there is one.
    ``on_progress`` prints to the operator; ``status`` keeps what the bench does.
    """

    def __init__(
        self,
        settings: BenchSettings,
        *,
        nominal: VehicleModel,
        link: RunnerLink,
        writer: CampaignWriter,
        campaign_time: CampaignTime,
        calibrate: Callable[[Collection[str]], VehicleModel],
        recorded: Mapping[str, Run],
        corrected: VehicleModel | None = None,
        session: SessionBegan = _UNNAMED,
        timing: Timing = DEFAULT_TIMING,
        limits: QualityLimits = DEFAULT_LIMITS,
        on_progress: Callable[[str], None] = notify_operator,
        status: RunnerStatus | None = None,
    ) -> None:
        self.settings = settings
        self.status = status or RunnerStatus(writer.path.name)
        self.link, self.writer = link, writer
        self.nominal, self._calibrate = nominal, calibrate
        self._calibrated: VehicleModel | None = None
        self._corrected = corrected
        self._on_progress = on_progress
        self._time, self._timing, self._limits = campaign_time, timing, limits
        self._identity = link.identity()
        self._latch, self.pause = Latch(), PauseRequest(writer.path, on_progress)
        self.log = EventLog(writer, on_progress, self.status.report)
        self._recorded, self._session = recorded, session
        self._unseen = 0
        self.awaited: set[str] = set()
        workspace = Workspace.parse(settings.workspace)
        safety = replace(DEFAULT_SAFETY, flickers=not self._identity.simulated, control_cycle_s=settings.exchange)
        turns_on_the_spot = nominal.geometry.is_differential
        self._supervisor = Supervisor(workspace, nominal.neutral, safety, turns_on_the_spot=turns_on_the_spot)
        self._placer = make_placer(settings.place, Rig(link, nominal, workspace, self._supervisor, limits, on_progress))

    def model(self, condition: str) -> VehicleModel:
        """Return the vehicle model that commands are computed with under `condition`.

        Raises
        ------
        FlagError
            If it is ``"corrected"`` and there is no such model.
        """
        if condition == "uncalibrated":
            return self.nominal
        if condition == "corrected":
            if self._corrected is None:
                raise FlagError("no corrected model", where="--corrected", remedy="give what a diagnosis wrote")
            return self._corrected
        if self._calibrated is None:
            self.status.enter(Phase.CALIBRATING)
            self._calibrated = self._calibrate(self.awaited)
        return self._calibrated

    @property
    def failure(self) -> Failure | None:
        """What ended the driving: the first failure of hardware, bus or disk."""
        return self._latch.failure

    @property
    def is_lock_step(self) -> bool:
        """Whether time passes only in exchanges."""
        return self._identity.lock_step

    @property
    def is_resumed(self) -> bool:
        """Whether runs were recorded before this session."""
        return bool(self._recorded)

    def check(self) -> None:
        """Raise `LinkError` if a failure ended the driving before."""
        self._latch.check()

    def expect_calibration(self, run_ids: Collection[str]) -> None:
        """Await the calibration runs `run_ids`, and those that were planned earlier and are not finished."""
        earlier = unfinished_calibration(self.writer.path, self._recorded, self.settings.attempts)
        self.awaited = earlier.union(run_ids)

    def done(self, run_ids: Collection[str]) -> set[str]:
        """Return which of these runs an earlier session finished."""
        attempts = attempts_by_run(self._recorded.values())
        return {run_id for run_id in run_ids if any(run.is_ok for run in attempts.get(run_id, []))}

    def outlook(self, run_ids: Collection[str]) -> str:
        """Return in words what is left to drive of these runs, and which of them were rejected before."""
        attempts, done = attempts_by_run(self._recorded.values()), self.done(run_ids)
        left = [run_id for run_id in run_ids if run_id not in done]
        again = [run_id for run_id in left if any(r.outcome is Outcome.REJECTED for r in attempts.get(run_id, []))]
        words = f"resumed: {len(done)} runs done, {len(left)} to drive"
        return f"{words}; rejected before and tried again: {', '.join(again)}" if again else words

    @property
    def departure(self) -> Departure:
        """When the next run begins, since the first of its session did."""
        return Departure(started_h=self._session.hours(self._time.now_s()))

    def run(self, request: RunRequest) -> Run:
        """Drive `request` until an attempt counts; return the last attempt.

        Attempts that an interrupted session recorded are not driven again; a simulated plant repeats them unseen,
        so that what wears or drains is as it was.

        Raises
        ------
        LinkError
            If hardware failed, now or earlier in this session: a bench that failed once drives no more.
        RecordingError
            If the run was driven and cannot be recorded; the bench drives no more, either.
        VehicleError
            If a command is out of the range of its channel: nothing was driven.
        """
        self.check()
        self.nominal.channels.require_within(request.commands, where=request.run_id)
        request = replace(request, session=self._session.name)
        with self._latch.remembering():
            for attempt in range(1, self._attempts(request) + 1):
                run = self._attempt(request, attempt)
                if run.is_ok:
                    break
        return run

    def close(self) -> None:
        """Keep what was reported since the last run."""
        self.log.take(self.link, "", self._time.now_s())
        with suppress(CampaignError):  # what ended the session is reported, not that this could not be recorded
            self.log.save()

    def _attempts(self, request: RunRequest) -> int:
        """Return how many attempts there are: as many again where all of an earlier session's were rejected."""
        limit = self.settings.attempts
        while _attempt_id(request, limit) in self._recorded and not self._recorded[_attempt_id(request, limit)].is_ok:
            limit += self.settings.attempts
        return limit

    def _attempt(self, request: RunRequest, attempt: int) -> Run:
        run_id = _attempt_id(request, attempt)
        if run_id in self._recorded:
            return self._repeat_unseen(request, self._recorded[run_id])
        self.status.begin(request, attempt)
        if self.pause.is_requested():
            self.status.enter(Phase.PAUSING)
        self.pause.wait(run_id, holding_neutral(self.link, self.nominal.neutral))
        request = self._placed(request, run_id)
        loop = self._closed_loop(request, run_id)
        started_s = self._time.now_s()
        self._session = self._session.with_run(started_s)
        self.log.take(self.link, "", started_s)
        seen: list[Frames] = []
        before: list[Event] = []
        stopped = False
        try:
            driven = self._drive(
                request, run_id, seen, loop, at_rest=lambda: before.extend(self.log.take(self.link, run_id, started_s))
            )
            request = as_sent(request, loop)
            status = self._status(request, driven, loop)
        except RunStoppedError as stop:
            stopped = True
            request = as_sent(request, loop)
            driven, status = self._stopped(request, seen, stop)
            self._on_progress(f"{run_id} {status}")
        except BaseException as error:
            record_aborted(self.writer, as_sent(request, loop), run_id, started_s, seen, error, self._identity.firmware)
            self.log.take(self.link, run_id, started_s)
            if isinstance(error, ControllerError):  # the session continues with the next run
                self._placer.was_moved()
                self._time.has_run(started_s, self._timing.rest_before_s + self._supervisor.commanded_until_s)
            raise
        events = self.log.take(self.link, run_id, started_s + driven.duration_s)
        if (count := len(before) + len(events)) and not self._identity.lock_step:
            request = replace(request, extra={**request.extra, "events": count})
        if not stopped and (event := not_as_planned(events)) is not None:
            status = str(RunStatus(Outcome.REJECTED, event.line))
        run = recorded_run(request, run_id, started_s, status, driven, self._identity.firmware)
        self.writer.append(run)
        self.log.save()
        self.status.end(run)
        self._time.has_run(started_s, driven.duration_s)
        self._check_seen(run)
        return run

    def _stopped(self, request: RunRequest, seen: list[Frames], stop: RunStoppedError) -> tuple[Drive, str]:
        """Return what was driven of a run that the supervisor stopped, and its status: it does not count."""
        self._placer.was_moved()
        rest_s = self._timing.rest_before_s
        driven = stopped_drive(request.commands, seen, max(self._supervisor.commanded_until_s, -rest_s), rest_s)
        reason = RunStoppedError(stop.what, value=stop.value, limit=stop.limit)
        return driven, str(RunStatus(Outcome.REJECTED, str(reason)))

    def _check_seen(self, run: Run) -> None:
        """Drive no more where the vehicle is never seen.

        Raises
        ------
        SafetyStopError
            Then.
        """
        self._unseen = 0 if run.frames.tracked.any() else self._unseen + 1
        if self._unseen >= _MOST_UNSEEN:
            raise SafetyStopError(
                "the vehicle is not seen", where=self.link.keys.root, value=f"in {self._unseen} runs in succession",
                remedy="look at camera and markers, then continue with --resume",
            )  # fmt: skip

    def _repeat_unseen(self, request: RunRequest, run: Run) -> Run:
        if self._identity.simulated:
            duration_s = float(str(run.extra["duration_s"]))
            commands, until_s = control_cycles_of(run.commands, self.nominal.neutral, duration_s, self._timing)
            self.link.replay(self._random_key(run.run_id), commands, pose=request.start, until_s=until_s)
            self._placer.was_moved()
            self._time.has_run(run.started_s, duration_s)
        return run

    def _placed(self, request: RunRequest, run_id: str) -> RunRequest:
        """Bring the vehicle to the start; return the request with what the campaign is to say of that."""
        self.status.enter(Phase.RETURNING if self.settings.place == "auto" else Phase.PLACING)
        placing = self._placer.place(request.start, self._random_key(run_id))
        if placing is None:
            return request
        self._time.has_placed(placing.duration_s)
        return replace(request, extra={**request.extra, **placing.columns()})

    def _closed_loop(self, request: RunRequest, run_id: str) -> ClosedLoop | None:
        """Return what drives an attempt closed loop; None for a run whose commands are known."""
        if request.control is None:
            return None
        return ClosedLoop(request.control, run_id, request.start, lock_step=self._identity.lock_step)

    def _drive(
        self,
        request: RunRequest,
        run_id: str,
        seen: list[Frames],
        loop: ClosedLoop | None,
        at_rest: Callable[[], object],
    ) -> Drive:
        self.status.enter(Phase.DRIVING)
        return drive(
            self.link,
            loop or request.commands,
            neutral=self.nominal.neutral,  # since a run's first command is the first recorded
            start=request.start,
            run_key=self._placer.run_key(self._random_key(run_id)),
            supervisor=self._supervisor,
            timing=self._timing,
            seen=seen,
            at_rest=at_rest,
        )

    def _random_key(self, run_id: str) -> str:
        """Return what a simulated run's randomness follows from: its name, and how often it was stopped before.

        By its name alone a camera would lose the vehicle in the same way whenever the session goes on.
        """
        stopped = times_stopped(run_id, self._recorded)
        return f"{run_id}-again{stopped}" if stopped else run_id

    def _status(self, request: RunRequest, driven: Drive, loop: ClosedLoop | None) -> str:
        if loop is not None and loop.complaint:
            return str(RunStatus(Outcome.REJECTED, loop.complaint))
        begin_s = -self._timing.rest_before_s
        quality = assess(
            driven.frames,
            start=request.start,
            begin_s=begin_s,
            end_s=begin_s + driven.duration_s,
            rate_hz=self._identity.mocap_rate_hz,
        )
        return quality.status(self._limits)


def _attempt_id(request: RunRequest, attempt: int) -> str:
    return request.run_id if attempt == 1 else f"{request.run_id}-attempt{attempt}"
