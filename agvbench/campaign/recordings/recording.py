"""A recording in SI units and the floor frame: rows of poses, and commands with times of their own."""

from __future__ import annotations

from collections.abc import Mapping as Named
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.recordings.jump_detection import jumped
from agvbench.campaign.recordings.mapping import Mapping
from agvbench.campaign.tables.schema import UNKNOWN_COUNT
from agvbench.errors import FileError
from agvbench.types import Commands, Floats, TimeSeries
from agvbench.vehicle.channels import ROLES
from agvbench.vehicle.wheels import WheelCommand

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Poses:
    """The poses of a recording, NaN where the vehicle was not seen; every array has shape (rows,).

    ``t_s`` [s] is in order, in the recording's own clock; ``mean_error_m`` [m] is the tracker's residual, and ``frame``
    its frame number, where it states them.
    """

    t_s: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats
    mean_error_m: Floats
    frame: NDArray[np.int64]

    @classmethod
    def of(cls, t_s: Floats, x_m: Floats, y_m: Floats, heading_rad: Floats) -> Poses:
        """Return poses of a tracker that states neither residual nor frame number."""
        return cls(t_s, x_m, y_m, heading_rad, np.full(len(t_s), np.nan), np.full(len(t_s), UNKNOWN_COUNT))

    @property
    def seen(self) -> Mask:
        """Rows with a pose."""
        return np.isfinite(self.x_m) & np.isfinite(self.y_m) & np.isfinite(self.heading_rad)


@dataclass(frozen=True)
class Recording:
    """A recording's rows; every array has shape (rows,).

    ``files`` are the files that it was read from; ``origin_s`` is what its times count from, in the clock that runs
    through all recordings [s]; ``commands`` are in command units and in the clock of the poses.
    ``seen`` marks rows with a pose, ``jumped`` those of them that the gate refuses, ``driven`` rows that the vehicle
    drove by itself with a known command, ``cut`` numbers the stretches in which the cut column keeps its value.
    ``logged`` are further quantities by name, in the clock of the poses.
    """

    path: Path
    files: tuple[Path, ...]
    poses: Poses
    commands: Commands
    seen: Mask
    jumped: Mask
    driven: Mask
    cut: NDArray[np.int64]
    origin_s: float = 0.0
    logged: Named[str, TimeSeries] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.poses.t_s)

    @property
    def name(self) -> str:
        """The name of the recording, from which the ids of its runs are made."""
        return recording_name(self.path)

    @property
    def t_s(self) -> Floats:
        """The time of each row [s]."""
        return self.poses.t_s

    @property
    def usable(self) -> Mask:
        """Rows that may enter a run as a tracked pose."""
        return self.driven & self.seen & ~self.jumped


def recording_name(path: Path) -> str:
    """Return the name of a recording: that of its file without the ending, or of its directory.

    >>> recording_name(Path("lab/monday.v2.csv"))
    'monday.v2'
    """
    return path.name if path.is_dir() else path.stem


def combine(
    path: Path,
    files: tuple[Path, ...],
    mapping: Mapping,
    poses: Poses,
    commands: Named[str, TimeSeries],
    flags: Named[str, Mask],
    cut: NDArray[np.int64] | None = None,
    *,
    logged: Named[str, TimeSeries] | None = None,
    origin_s: float = 0.0,
) -> Recording:
    """Return the recording of these poses and commands (by role); a role without commands stays at neutral.

    `flags` may say by ``"tracked"`` and ``"driven"`` which rows count. `logged` are further quantities.

    Raises
    ------
    FileError
        If poses and commands have no time in common, or times are much coarser than poses.
    """
    rows = len(poses.t_s)
    every = np.ones(rows, np.bool_)
    seen = poses.seen & flags.get("tracked", every)
    _require_fine_times(path, poses.t_s[seen], poses.x_m[seen], poses.y_m[seen])
    wild = np.zeros(rows, np.bool_)
    if mapping.gate:
        positions = (poses.x_m[seen], poses.y_m[seen], poses.heading_rad[seen])
        wild[seen] = jumped(poses.t_s[seen], *positions, mapping.gate)
    together = _together(commands, mapping.header(path))
    if rows and len(together):
        _require_common_time(path, poses, together)
    known_s = together.t_s[0] if len(together) else np.inf
    driven = flags.get("driven", every) & (poses.t_s >= known_s)
    stretches = np.zeros(rows, np.int64) if cut is None else cut
    return Recording(path, files, poses, together, seen, wild, driven, stretches, origin_s, logged or {})


def _together(commands: Named[str, TimeSeries], header: CampaignHeader) -> Commands:
    """Return one row for each time at which a command was given, once all are known; wheels as the body's motion."""
    times = np.unique(np.concatenate([series.t_s for series in commands.values()]))
    held = {name: series.held_at(times) for name, series in commands.items()}
    if (wheels := header.channels.wheels) is not None:
        body = wheels.body(*(held[name] for name in WheelCommand._fields))
        held = dict(zip(("drive", "front"), body, strict=True))
    held = {role: held.get(role, np.full(len(times), getattr(header.neutral, role))) for role in ROLES}
    known = np.isfinite(np.column_stack(list(held.values()))).all(axis=1)
    return Commands(t_s=times[known], **{role: values[known] for role, values in held.items()})


def _require_common_time(path: Path, poses: Poses, commands: Commands) -> None:
    """Raise `FileError` if all poses are before the first command, or long after the last of several."""
    begin_s, end_s = poses.t_s[0], poses.t_s[-1]
    first_s, last_s = commands.t_s[0], commands.t_s[-1]
    if end_s < first_s:
        told = f"the last pose at {end_s:.3f} s, the first command at {first_s:.3f} s"
        raise _apart(path, "all poses are before the first command", told)
    varies = any(np.ptp(getattr(commands, role)) > 0.0 for role in ROLES)
    if varies and begin_s > last_s + _LONGEST_HELD_S:
        told = f"the first pose at {begin_s:.3f} s, the last command at {last_s:.3f} s"
        raise _apart(path, "all poses are long after the last command", told)


def _require_fine_times(path: Path, t_s: Floats, x_m: Floats, y_m: Floats) -> None:
    """Raise `FileError` if most poses that moved have the time of the pose before, and times are far apart."""
    moved = np.hypot(np.diff(x_m), np.diff(y_m)) > _MOVED_M
    later_s = np.diff(t_s)
    if not (moved.any() and (later_s > 0.0).any()):
        return
    share, interval_s = float(np.mean(later_s[moved] == 0.0)), float(np.median(later_s[later_s > 0.0]))
    if share > _MOST_SHARED and interval_s > _COARSEST_S * (1.0 + _ROUNDING):
        raise FileError(
            "times are coarser than poses",
            where=path,
            value=f"{share:.0%} of the poses that moved have the time of the pose before, and times are "
            f"{interval_s:.3g} s apart",
            limit=f"{_COARSEST_S:g} s apart",
            remedy="write times with more digits",
        )


def _apart(path: Path, what: str, told: str) -> FileError:
    remedy = 'give both one clock: correct their times in the mapping (of a bag: time = "received" or "header")'
    return FileError(what, where=path, value=told, remedy=remedy)


_LONGEST_HELD_S = 60.0
"""A last command that has been held for longer before the first pose is of another clock."""

_MOVED_M, _MOST_SHARED, _COARSEST_S, _ROUNDING = 1e-3, 0.5, 0.05, 1e-6
"""Poses that are further apart than noise are different ones, and one that is so early or late is a wrong one."""
