"""Drive one run over the bus: rest, timed commands, stop, settle. Whatever happens, the vehicle stops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from agvbench.running.links import RunnerLink
from agvbench.running.rest_detection import is_at_rest
from agvbench.running.supervision.supervisor import Supervisor, safety_stop
from agvbench.types import Command, Commands, Frames, Pose


@dataclass(frozen=True)
class Timing:
    """How long the vehicle stands still around a run [s]: before it, after it, and at most after it.

    The end pose is read from frames at rest, so a run lasts until the vehicle stands still, and is judged as it
    is if it never does.
    """

    rest_before_s: float = 0.5
    settle_s: float = 1.5
    settle_step_s: float = 0.5
    settle_limit_s: float = 4.0


DEFAULT_TIMING = Timing()
_RECENT = 30


@dataclass(frozen=True)
class Drive:
    """What was sent and seen: commands in, frames out, and the time from first rest to last frame [s]."""

    commands: Commands
    frames: Frames
    duration_s: float


class TimedCommand(NamedTuple):
    """A command to be sent at `t_s` [s] of the run's clock and held for `hold_s` [s]; the last, a stop, for 0."""

    t_s: float
    command: Command
    hold_s: float


CommandSource = Callable[[list[Frames]], Iterator[TimedCommand]]
"""Yields a run's commands one by one; each may depend on the frames seen by then, to which `drive` adds."""


def planned(commands: Commands) -> CommandSource:
    """Return the source of commands that are known before the run."""

    def timed(_: list[Frames]) -> Iterator[TimedCommand]:
        t_s = commands.t_s.tolist()
        for i, (at_s, until_s) in enumerate(zip(t_s, [*t_s[1:], t_s[-1]], strict=True)):
            yield TimedCommand(at_s, commands.at(i), until_s - at_s)

    return timed


def as_commands(sent: list[TimedCommand]) -> Commands:
    """Return what was sent, which is at least one command, as timed commands."""
    return Commands(*np.array([(t_s, *command) for t_s, command, _ in sent], dtype=float).T.copy())


def drive(
    link: RunnerLink,
    commands: Commands | CommandSource,
    *,
    neutral: Command,
    start: Pose,
    run_key: str | None,
    supervisor: Supervisor,
    timing: Timing = DEFAULT_TIMING,
    seen: list[Frames] | None = None,
    at_rest: Callable[[], object] = lambda: None,
) -> Drive:
    """Drive `commands` from `start` and return everything seen.

    The last of `commands` stops the vehicle. `run_key` names a simulated run, whose randomness follows from it;
    None is for real vehicles, which stand at `start` already. `supervisor` stops the vehicle when something is wrong.
    `seen` is filled batch by batch, for a caller that keeps the frames of a failed run.
    `at_rest` is called after the rest, before the first of `commands`.

    Raises
    ------
    SafetyStopError
        If the supervisor stopped the vehicle.
    LinkError
        If the bus or an adapter fails; the vehicle has been commanded to stop.
    """
    batches = [] if seen is None else seen
    source = planned(commands) if isinstance(commands, Commands) else commands
    sent: list[TimedCommand] = []
    watched = partial(supervisor.control_cycle, link, seen=batches)
    supervisor.begin()
    try:
        if run_key is not None:
            link.reset(start, run_key=run_key)
        watched(neutral, t_s=-timing.rest_before_s, hold_s=timing.rest_before_s)
        _check_seen(batches, timing, where=link.keys.root)
        at_rest()
        for timed in source(batches):
            sent.append(timed)
            if timed.hold_s > 0.0:
                watched(timed.command, t_s=timed.t_s, hold_s=timed.hold_s)
        end_s = _settle(watched, sent[-1], batches, timing)
        batches.append(link.flush())
    except BaseException:
        # Ctrl-C, a lost adapter, a bug: before anything else the vehicle stands still.
        link.stop()
        raise
    frames = _until(Frames.concatenate(batches), end_s)
    return Drive(as_commands(sent), frames, timing.rest_before_s + end_s)


def _check_seen(batches: list[Frames], timing: Timing, *, where: str) -> None:
    """Refuse to drive a vehicle that was never seen at rest: its path could not be supervised."""
    if not any(frames.tracked.any() for frames in batches):
        value = f"not seen for {timing.rest_before_s:.2f} s, at rest"
        raise safety_stop(0.0, "tracking was lost", where=where, value=value, ends_session=False)


def _settle(watched: Callable[..., None], stop: TimedCommand, batches: list[Frames], timing: Timing) -> float:
    """Hold the last command until the vehicle stands still; return when that was [s]."""
    t_s, last, _ = stop
    limit_s = t_s + timing.settle_limit_s
    watched(last, t_s=t_s, hold_s=timing.settle_s)
    t_s += timing.settle_s
    while t_s < limit_s and not is_at_rest(Frames.concatenate(batches[-_RECENT:]), until_s=t_s):
        watched(last, t_s=t_s, hold_s=timing.settle_step_s)
        t_s += timing.settle_step_s
    return t_s


def _until(frames: Frames, end_s: float) -> Frames:
    """Leave out frames that were captured after the run's end."""
    return frames.select(np.asarray(frames.t_s <= end_s + 1e-9))


def control_cycles_of(
    commands: Commands, neutral: Command, duration_s: float, timing: Timing = DEFAULT_TIMING
) -> tuple[Commands, float]:
    """Return every exchange that `drive` made for a run of `duration_s`, and when the last ended [s]."""
    end_s = duration_s - timing.rest_before_s
    settled_s = float(commands.t_s[-1]) + timing.settle_s
    extra = max(0, round((end_s - settled_s) / timing.settle_step_s))
    t_s = [-timing.rest_before_s, *commands.t_s, *(settled_s + k * timing.settle_step_s for k in range(extra))]
    last = commands.at(len(commands) - 1)
    rows = [neutral, *(commands.at(i) for i in range(len(commands))), *[last] * extra]
    drive_, front, rear = np.array(rows, dtype=float).T
    return Commands(np.array(t_s, dtype=float), drive_, front, rear), end_s
