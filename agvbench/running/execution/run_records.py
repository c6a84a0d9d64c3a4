"""Run records: from an order and what was seen to a run of the campaign."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from agvbench.campaign import CampaignWriter
from agvbench.campaign.attempts import INTERRUPTED
from agvbench.campaign.completeness import planned_id
from agvbench.campaign.tables.consistency import CLOCK_TOLERANCE_S
from agvbench.errors import CampaignError, SafetyStopError
from agvbench.running.execution.closed_loop import ClosedLoop, Control
from agvbench.running.execution.drive import Drive
from agvbench.types import Commands, Frames, Outcome, Pose, Run, RunStatus

_ABORTED = "-aborted"
# Column of the runs table: whether a safety rule stopped the run.
_SAFETY_STOP = "safety_stop"


@dataclass(frozen=True)
class RunRequest:
    """What is to be driven: the plan of one run, before any attempt at it."""

    run_id: str
    experiment: str
    trajectory: str
    condition: str
    repeat: int
    commands: Commands
    target: Pose
    start: Pose
    session: str | None = None
    extra: Mapping[str, object] = field(default_factory=dict)
    control: Control | None = None
    """What drives the run closed loop, from the same start; ``commands`` are then those of the open-loop plan."""


def as_sent(request: RunRequest, loop: ClosedLoop | None) -> RunRequest:
    """Return `request` with the commands that `loop` sent and what it measured; unchanged without a loop."""
    if loop is None:
        return request
    return replace(request, commands=loop.commands or request.commands, extra={**request.extra, **loop.columns()})


def recorded_run(request: RunRequest, run_id: str, started_s: float, status: str, driven: Drive, firmware: str) -> Run:
    """Return the run that `request` became."""
    extra = {**request.extra, "duration_s": driven.duration_s}
    return _run(request, run_id, started_s, status, driven.commands, driven.frames, firmware, extra)


def stopped_drive(commands: Commands, seen: list[Frames], until_s: float, rest_before_s: float) -> Drive:
    """Return what became of a run whose exchanges ended at `until_s` [s]: the commands sent by then."""
    sent = np.asarray(commands.t_s < until_s)
    sent[0] = True
    commands = Commands(*(column[sent] for column in vars(commands).values()))
    return Drive(commands, Frames.concatenate(seen), rest_before_s + until_s)


def aborted_run(
    request: RunRequest, run_id: str, started_s: float, error: BaseException, frames: Frames, firmware: str
) -> Run:
    """Return what is left of a run that `error` ended: its frames, and the commands sent until the last of them."""
    why = INTERRUPTED if isinstance(error, KeyboardInterrupt) else str(error) or type(error).__name__
    last_s = float(np.max(frames.t_s))
    sent = np.asarray(request.commands.t_s <= max(last_s, 0.0))
    commands = Commands(*(column[sent] for column in vars(request.commands).values()))
    extra: dict[str, object] = {**request.extra, "duration_s": last_s - float(np.min(frames.t_s))}
    if isinstance(error, SafetyStopError):
        extra[_SAFETY_STOP] = True
    status = str(RunStatus(Outcome.ABORTED, why))
    return _run(request, run_id, started_s, status, commands, frames, firmware, extra)


def record_aborted(
    writer: CampaignWriter,
    request: RunRequest,
    run_id: str,
    started_s: float,
    seen: list[Frames],
    error: BaseException,
    firmware: str,
) -> None:
    """Keep what was `seen` of a run that `error` ended; nothing where nothing was seen."""
    frames = Frames.concatenate(seen)
    # A camera whose clock was set ends a run; what it said since then lies far outside the run.
    last_s = float(request.commands.t_s[-1]) + CLOCK_TOLERANCE_S
    frames = frames.select((frames.t_s >= -CLOCK_TOLERANCE_S) & (frames.t_s <= last_s))
    if not len(frames):
        return
    name = free_name(run_id + _ABORTED, writer.finished_ids)
    with suppress(CampaignError):  # what ended the run is reported, not that it could not be recorded
        writer.append(aborted_run(request, name, started_s, error, frames, firmware))


def times_stopped(run_id: str, recorded: Mapping[str, Run]) -> int:
    """Return how often the supervisor has stopped the run `run_id`, going by what was `recorded`."""
    return sum(
        name.startswith(run_id + _ABORTED) and bool(run.extra.get(_SAFETY_STOP)) for name, run in recorded.items()
    )


def attempts_by_run(recorded: Iterable[Run]) -> dict[str, list[Run]]:
    """Return the recorded attempts by the id of the planned run."""
    attempts: dict[str, list[Run]] = {}
    for run in recorded:
        attempts.setdefault(planned_id(run.run_id), []).append(run)
    return attempts


def free_name(stem: str, taken: Collection[str]) -> str:
    """Return the first of ``stem1``, ``stem2``, … that is not taken.

    >>> free_name("left-r01-aborted", {"left-r01-aborted1"})
    'left-r01-aborted2'
    """
    return next(name for k in range(1, len(taken) + 2) if (name := f"{stem}{k}") not in taken)


def _run(
    request: RunRequest,
    run_id: str,
    started_s: float,
    status: str,
    commands: Commands,
    frames: Frames,
    firmware: str,
    extra: Mapping[str, object],
) -> Run:
    return Run(
        run_id=run_id,
        experiment=request.experiment,
        trajectory=request.trajectory,
        condition=request.condition,
        repeat=request.repeat,
        target=request.target,
        started_s=started_s,
        status=status,
        firmware=firmware,
        commands=commands,
        frames=frames,
        session=request.session,
        extra=extra,
    )
