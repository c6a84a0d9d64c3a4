"""The runner's state: what a bench does now, for observers. Only the last value counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta
from msgspec.structs import force_setattr

from agvbench.bus.messages.codec import Message, Number, Source, decoder
from agvbench.bus.messages.texts import cut, short
from agvbench.errors import MessageError
from agvbench.types import Command, Pose

MAX_NAME, MAX_LINE, MAX_ENTRIES = 200, 400, 8
Name = Annotated[str, Meta(max_length=MAX_NAME)]
Line = Annotated[str, Meta(max_length=MAX_LINE)]
_Entry = TypeVar("_Entry")


class Phase(StrEnum):
    """What a runner does."""

    STARTING = "starting"
    CALIBRATING = "calibrating"
    """Fits the maps from the calibration runs."""
    PLACING = "placing"
    """Software or an operator brings the vehicle to its start."""
    RETURNING = "returning"
    """The vehicle drives itself back to its start."""
    DRIVING = "driving"
    SETTLING = "settling"
    """The last command stops the vehicle; the run ends when it is at rest."""
    PAUSING = "pausing"
    FINISHED = "finished"


class RunProgress(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The run that is driven: ``number`` of how many, and ``t_s`` of ``duration_s`` in the run's clock [s].

    The clock is negative while the vehicle is observed at rest before the first command.
    """

    number: Number
    of: Number
    run_id: Name
    experiment: Name
    trajectory: Name
    condition: Name
    repeat: Number
    attempt: Number
    t_s: float
    duration_s: float

    def __post_init__(self) -> None:
        cut(self, ("run_id", "experiment", "trajectory", "condition"), MAX_NAME, mark="…")
        if not (math.isfinite(self.t_s) and 0.0 <= self.duration_s < math.inf):
            value, limit = f"{self.t_s} of {self.duration_s} s", "finite, from 0 s"
            raise MessageError("progress of a run is out of range", value=value, limit=limit)
        if self.number > self.of:
            raise MessageError("number of a run is out of range", value=self.number, limit=f"at most {self.of}")


class RunResult(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A recorded run: its status, and its end position error [mm] and heading error [deg] where it has a target."""

    run_id: Name
    status: Line
    position_mm: float | None = None
    heading_deg: float | None = None

    def __post_init__(self) -> None:
        cut(self, ("run_id",), MAX_NAME, mark="…")
        cut(self, ("status",), MAX_LINE, mark="…")
        numbers = [number for number in (self.position_mm, self.heading_deg) if number is not None]
        if not all(map(math.isfinite, numbers)):
            raise MessageError("result of a run is not finite", where=self.run_id, value=numbers)


class RunnerState(Message, tag="runner_state", frozen=True):
    """What a runner does now.

    ``source`` is that of its commands and of its liveliness token. ``elapsed_s`` is the time since the session began,
    in the runner's own clock: clocks of two machines need not agree. ``pose`` (floor frame) is the last tracked one of
    the last exchange, None where the vehicle was not tracked. ``counted`` and ``rejected`` are runs of this session.
    ``faults`` and ``results`` are the last `MAX_ENTRIES`, oldest first; ``fault_count`` is the number of all faults.
    ``failure`` is what ended the session before its time. Texts are cut where they are too long.

    Raises
    ------
    MessageError
        If a number is out of range, or there are too many entries.
    """

    sequence: Number
    source: Source
    campaign: Name
    version: Name
    phase: Phase
    began_unix_s: float
    elapsed_s: float
    run: RunProgress | None = None
    pose: Pose | None = None
    command: Command | None = None
    counted: Number = 0
    rejected: Number = 0
    faults: tuple[Line, ...] = ()
    fault_count: Number = 0
    results: tuple[RunResult, ...] = ()
    failure: Line | None = None

    def __post_init__(self) -> None:
        cut(self, ("campaign", "version"), MAX_NAME, mark="…")
        cut(self, ("failure",), MAX_LINE, mark="…")
        force_setattr(self, "faults", tuple(short(line, MAX_LINE, mark="…") for line in self.faults))
        if not (0.0 <= self.began_unix_s < math.inf and 0.0 <= self.elapsed_s < math.inf):
            value = f"{self.began_unix_s}, {self.elapsed_s} s"
            raise MessageError("times of a runner are out of range", value=value, limit="finite, from 0 s")
        for name, numbers in (("pose", self.pose), ("command", self.command)):
            if numbers is not None and not all(map(math.isfinite, numbers)):
                raise MessageError(f"{name} of a runner is not finite", value=tuple(numbers))
        _check_entries("faults", self.faults)
        _check_entries("results", self.results)

    def faults_since(self, count: int) -> tuple[Line, ...]:
        """Return those of `faults` that came after the first `count` of all."""
        return _last(self.faults, self.fault_count - count)

    def results_since(self, count: int) -> tuple[RunResult, ...]:
        """Return those of `results` that came after the first `count` runs that were counted or rejected."""
        return _last(self.results, self.counted + self.rejected - count)


def _last(entries: tuple[_Entry, ...], count: int) -> tuple[_Entry, ...]:
    return entries[len(entries) - min(max(count, 0), len(entries)) :]


def _check_entries(name: str, entries: Sequence[object]) -> None:
    if len(entries) > MAX_ENTRIES:
        raise MessageError(f"too many {name} of a runner", value=len(entries), limit=f"at most {MAX_ENTRIES}")


decode_runner_state = decoder(RunnerState)
