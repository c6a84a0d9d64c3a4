"""Read poses from a TUM file, and the commands from the CSV beside it."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from agvbench.campaign.recordings.csv_recording import Cells
from agvbench.campaign.recordings.mapping import Mapping, PoseSource
from agvbench.campaign.recordings.recording import Poses, Recording, combine
from agvbench.campaign.tables.csv_text import MAX_BYTES
from agvbench.errors import FileError
from agvbench.text_files import require_regular
from agvbench.types import Floats, TimeSeries
from agvbench.vehicle.quaternion import floor_poses

_COLUMNS = "t x y z qx qy qz qw"


def read_tum_recording(path: Path, mapping: Mapping) -> Recording:
    """Read the poses of `path`, and the commands of the CSV of the same name beside it, which has the same clock.

    Raises
    ------
    FileError
        If a file or a mapped column is missing, a line is not ``t x y z qx qy qz qw``, or time goes backwards.
    CampaignError
        If a cell of the CSV is not a number.
    """
    assert mapping.pose is not None  # noqa: S101 - read_recording has looked
    poses = read_tum(path, mapping.pose)
    beside = commands_beside(path)
    cells = Cells(beside, mapping)
    t_s = cells.time()
    flags = {
        name: TimeSeries(t_s, cells.flag(flag).astype(np.float64)).held_at(poses.t_s) == 1.0
        for name, flag in mapping.flags.items()
    }
    commands, logged = cells.series(mapping.commands, t_s), cells.series(mapping.logged, t_s)
    return combine(path, (path, beside), mapping, poses, commands, flags, logged=logged)


def commands_beside(path: Path) -> Path:
    """Return the CSV of the commands of a TUM file; raise `FileError` if there is none."""
    beside = path.with_suffix(".csv")
    if not beside.is_file():
        remedy = f"put them into {beside.name} (docs/how-to/exchange-with-ros.md)"
        raise FileError("has no commands beside it, without which no run can be analysed", where=path, remedy=remedy)
    return beside


def read_tum(path: Path, source: PoseSource) -> Poses:
    """Read a TUM file (Sturm et al. 2012): lines of ``t x y z qx qy qz qw`` in s, m and a unit quaternion.

    Raises
    ------
    FileError
        If the file cannot be read, a line is something else, or time goes backwards.
    """
    rows = _numbers(path)
    back = np.flatnonzero(~(np.diff(rows[:, 0]) >= 0.0))
    if len(back):
        remedy = "sort the lines by time"
        raise FileError(f"pose {back[0] + 2}: time goes backwards, or is no number", where=path, remedy=remedy)
    return Poses.of(
        rows[:, 0], *floor_poses(rows[:, 1:4], rows[:, 4:8], source.forward, source.floor_x, source.floor_y)
    )


def _numbers(path: Path) -> Floats:
    """Return the file's numbers, shape (poses, 8)."""
    try:
        require_regular(path)
        if (size := path.stat().st_size) > MAX_BYTES:
            raise FileError("is too large", where=path, value=f"{size} bytes", limit=f"{MAX_BYTES} bytes")
        with path.open(encoding="utf-8") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # "input contained no data": said below
            rows = np.loadtxt(file, ndmin=2)
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", where=path, remedy="check the path") from None
    except ValueError as error:
        reason = " ".join(str(error).split())[:120]
        raise FileError(f"is not a TUM file ({reason})", where=path, limit=_COLUMNS, remedy="correct it") from None
    if rows.shape[1] != len(_COLUMNS.split()) or not len(rows):
        found = f"{rows.shape[1]} columns" if len(rows) else "no lines"
        raise FileError("is not a TUM file", where=path, value=found, limit=_COLUMNS, remedy="correct it")
    return np.asarray(rows)
