"""The nouns: poses, commands, frames, runs, and the plant protocol.

Frames of reference: the *floor frame* is the motion capture system's ground plane, x and y in metres,
heading in radians counter-clockwise from x. The *start frame* has its origin at a run's start pose.
Units are SI and radians; commands are in the vehicle's own unit (µs of servo pulse, or −1…1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import wraps
from typing import Concatenate, Literal, NamedTuple, ParamSpec, Protocol, Self, TypeVar, runtime_checkable
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CommandUnit = Literal["us", "normalised", "si"]
Kinematics = Literal["two_axle", "differential"]
"""How a vehicle turns: by the angles of its axles, or by the difference of the speeds of its left and right wheels."""
"""Pulse widths in µs; −1…1; or m/s, and rad of an axle or rad/s of a vehicle that turns by its wheels' speeds."""

RUN_OK = "ok"


class Outcome(StrEnum):
    """What became of a run: it counts, its quality or its course was refused, or it ended early."""

    OK = RUN_OK
    REJECTED = "rejected"
    ABORTED = "aborted"


@dataclass(frozen=True)
class RunStatus:
    """The column ``status`` of the runs table: an outcome, and the reason of one that does not count.

    >>> str(RunStatus(Outcome.REJECTED, "12 frames lost"))
    'rejected: 12 frames lost'
    >>> RunStatus.parse("aborted: interrupted").outcome is Outcome.ABORTED
    True
    """

    outcome: Outcome
    reason: str = ""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the status that a column holds; raise `ValueError` if it holds none."""
        outcome, separator, reason = text.partition(": ")
        if (outcome == Outcome.OK) is bool(separator):
            raise ValueError(text)
        return cls(Outcome(outcome), reason)

    def __str__(self) -> str:
        """Return what the column holds."""
        return f"{self.outcome}: {self.reason}" if self.reason else str(self.outcome)


CONDITIONS = ("uncalibrated", "calibrated", "corrected")
CALIBRATION_EXPERIMENTS = ("steering_front", "steering_rear", "steering_opposite", "drive", "yaw_rate")
"""The experiments whose runs hold one command each, for static maps."""


_P = ParamSpec("_P")
_T = TypeVar("_T")
_Angle = TypeVar("_Angle", float, Floats)


def wrap_angle(angle_rad: _Angle) -> _Angle:
    """Wrap an angle, or an array of them, to (−π, π].

    >>> round(wrap_angle(3 * math.pi / 2), 6)
    -1.570796
    """
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


class Pose(NamedTuple):
    """A planar pose: position [m] and heading [rad, counter-clockwise]."""

    x_m: float
    y_m: float
    heading_rad: float

    def compose(self, other: Pose) -> Pose:
        """Return `other`, given in this pose's frame, in the frame this pose is given in."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose(
            self.x_m + c * other.x_m - s * other.y_m,
            self.y_m + s * other.x_m + c * other.y_m,
            wrap_angle(self.heading_rad + other.heading_rad),
        )

    def place(self, points: Floats) -> Floats:
        """Return points (n, 2) [m], given in this pose's frame, in the frame this pose is given in.

        >>> Pose(1.0, 2.0, math.pi / 2).place(np.array([[1.0, 0.0]])).round(9).tolist()
        [[1.0, 3.0]]
        """
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array([self.x_m, self.y_m]))

    def relative_to(self, start: Pose) -> Pose:
        """Return this pose in the frame of `start`.

        >>> Pose(3.0, 2.0, 0.5).relative_to(Pose(1.0, 1.0, 0.0))
        Pose(x_m=2.0, y_m=1.0, heading_rad=0.5)
        """
        dx, dy = self.x_m - start.x_m, self.y_m - start.y_m
        c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
        return Pose(c * dx + s * dy, -s * dx + c * dy, wrap_angle(self.heading_rad - start.heading_rad))

    @property
    def is_finite(self) -> bool:
        """Whether all three numbers are finite (a target of NaN means: no target)."""
        return all(map(math.isfinite, self))


NO_TARGET = Pose(math.nan, math.nan, math.nan)


class Command(NamedTuple):
    """What the vehicle is commanded at one moment, in its own command unit."""

    drive: float
    front: float
    rear: float


@dataclass(frozen=True)
class Commands:
    """Timed commands: row i holds from ``t_s[i]`` until ``t_s[i + 1]``; the last row holds on.

    All arrays have shape (n,); ``t_s`` [s] increases strictly and starts at 0 for a run's first command.
    """

    t_s: Floats
    drive: Floats
    front: Floats
    rear: Floats

    def __len__(self) -> int:
        return len(self.t_s)

    def at(self, index: int) -> Command:
        """Return row `index` as a `Command`."""
        return Command(float(self.drive[index]), float(self.front[index]), float(self.rear[index]))

    def without_repeats(self) -> Commands:
        """Return the rows that differ from the row before: the same command over time, in fewer rows.

        Examples
        --------
        >>> held = Commands(np.arange(4.0), np.array([1.0, 1.0, 2.0, 2.0]), np.zeros(4), np.zeros(4))
        >>> held.without_repeats().t_s.tolist()
        [0.0, 2.0]
        """
        rows = np.column_stack([self.drive, self.front, self.rear])
        changes = np.append(True, np.any(rows[1:] != rows[:-1], axis=1))[: len(rows)]
        return Commands(*(getattr(self, f.name)[changes] for f in fields(self)))


@dataclass(frozen=True, eq=False)
class Frames:
    """Motion capture frames of one vehicle, in order of arrival; every array has shape (n,) and is not changed.

    ``t_s`` [s] is the capture time in the run's clock (0 = first command published; frames at rest before
    it are negative); ``x_m``, ``y_m`` [m] and ``heading_rad`` [rad] are in the floor frame and NaN where
    ``tracked`` is False; ``frame`` is the camera's frame number (−1 unknown), ``mean_error_m`` [m] its own
    marker residual (NaN unknown), ``received_s`` [s] when the frame arrived, in the same clock as ``t_s``
    (NaN unknown).
    """

    t_s: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats
    tracked: NDArray[np.bool_]
    frame: NDArray[np.int64]
    mean_error_m: Floats
    received_s: Floats

    def __len__(self) -> int:
        return len(self.t_s)

    @classmethod
    def empty(cls) -> Frames:
        """Return no frames."""
        none = np.empty(0)
        return cls(none, none, none, none, np.empty(0, np.bool_), np.empty(0, np.int64), none, none)

    @classmethod
    def concatenate(cls, batches: list[Frames]) -> Frames:
        """Return all batches one after another."""
        if not batches:
            return cls.empty()
        return cls(*(np.concatenate([getattr(batch, f.name) for batch in batches]) for f in fields(cls)))

    def select(self, mask: NDArray[np.bool_] | NDArray[np.int64]) -> Frames:
        """Return the frames that a boolean mask or an index array chooses."""
        return Frames(*(getattr(self, f.name)[mask] for f in fields(self)))


def kept_by_frames(measure: Callable[Concatenate[Frames, _P], _T]) -> Callable[Concatenate[Frames, _P], _T]:
    """Return `measure`, which keeps what it found for as long as the frames exist: a report asks it many times."""
    found: WeakKeyDictionary[Frames, dict[object, _T]] = WeakKeyDictionary()

    @wraps(measure)
    def kept(frames: Frames, /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        of_frames = found.setdefault(frames, {})
        key = (args, *kwargs.items())
        if key not in of_frames:
            of_frames[key] = measure(frames, *args, **kwargs)
        return of_frames[key]

    return kept


class TimeSeries(NamedTuple):
    """A quantity at times of its own: ``t_s`` (n,) [s] and ``value`` (n,), NaN where unknown."""

    t_s: Floats
    value: Floats

    def held_at(self, t_s: Floats) -> Floats:
        """Return the value that holds at each of `t_s`, if times are in order; NaN before the first."""
        if not len(self.t_s):
            return np.full(len(t_s), np.nan)
        index = np.searchsorted(self.t_s, t_s, side="right") - 1
        return np.where(index >= 0, self.value[index], np.nan)


@dataclass(frozen=True)
class Run:
    """One drive of one experiment under one condition: a row of ``runs`` with its commands and poses.

    ``target`` is in the start frame (`NO_TARGET` where there is none); ``started_s`` [s] counts from the
    beginning of the campaign; ``status`` is ``"ok"``, ``"rejected: WHY"`` or ``"aborted: WHY"``.
    ``extra`` holds further columns of the runs table, kept as they are; ``logged`` further numeric columns of the poses
    table, on the clock of the run.
    """

    run_id: str
    experiment: str
    trajectory: str
    condition: str
    repeat: int
    target: Pose
    started_s: float
    status: str
    firmware: str
    commands: Commands
    frames: Frames
    session: str | None = None
    split: str | None = None
    extra: Mapping[str, object] = field(default_factory=dict)
    logged: Mapping[str, TimeSeries] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """Whether the run counts."""
        return self.status == RUN_OK

    @property
    def outcome(self) -> Outcome:
        """What became of the run."""
        return RunStatus.parse(self.status).outcome


@runtime_checkable
class Plant(Protocol):
    """What really drives, as far as the bench can see. A factory is ``make_plant(seed: int) -> Plant``."""

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put the vehicle at rest at `pose` (m, m, rad); what wears, drains or warms goes on."""

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Hold the command for `dt` seconds; return the true pose of the marker centroid (m, m, rad)."""
        ...


class PlantFactory(Protocol):
    """Makes plants; the same seed makes the same plant."""

    def __call__(self, seed: int) -> Plant:
        """Return a plant whose own randomness follows from `seed`."""
        ...
