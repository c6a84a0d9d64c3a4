"""Read one foreign CSV as its mapping declares: SI, radians, the floor frame, commands held until the next."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from agvbench.campaign.recordings.jump_detection import jumped
from agvbench.campaign.recordings.mapping import ISO_8601, TIME, Flag, Mapping, factor, quantities
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.campaign.tables.schema import UNKNOWN_COUNT, ColumnSpec, Kind, fill_columns, type_columns
from agvbench.errors import FileError
from agvbench.types import Command, Floats
from agvbench.vehicle.quaternion import heading_of
from agvbench.vehicle.wheels import WheelCommand


@dataclass(frozen=True)
class Recording:
    """A recording's rows; every array has shape (rows,).

    ``t_s`` is in the recording's own clock; ``drive``, ``front``, ``rear`` are in command units. ``seen`` marks
    rows with a pose, ``jumped`` those of them that the gate refuses, ``driven`` rows that the vehicle drove by
    itself with a known command, ``cut`` numbers the stretches in which the cut column keeps its value.
    """

    path: Path
    t_s: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats
    mean_error_m: Floats
    frame: NDArray[np.int64]
    drive: Floats
    front: Floats
    rear: Floats
    seen: Mask
    jumped: Mask
    driven: Mask
    cut: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def usable(self) -> Mask:
        """Rows that may enter a run as a tracked pose."""
        return self.driven & self.seen & ~self.jumped


def read_recording(path: Path, mapping: Mapping) -> Recording:
    """Read `path` as `mapping` declares.

    Raises
    ------
    FileError
        If the file or a mapped column is missing, or time goes backwards.
    CampaignError
        If a cell is not a number.
    """
    cells = Cells(path, mapping)
    columns = mapping.columns
    t_s = _time(cells)
    measured = {
        name: cells.number(q.column, factor(q.unit, known, path) * q.scale, q.offset)
        for name, q, known in quantities(mapping)
    }
    heading = measured["heading"] if "heading" in measured else _heading(cells)
    missing = np.full(len(t_s), np.nan)
    seen = np.isfinite(measured["x"]) & np.isfinite(measured["y"]) & np.isfinite(heading) & cells.flag(columns.tracked)
    wild = np.zeros(len(t_s), np.bool_)
    if mapping.gate:
        wild[seen] = jumped(t_s[seen], measured["x"][seen], measured["y"][seen], heading[seen], mapping.gate)
    commands = _commands(cells)
    known_command = np.all([np.isfinite(command) for command in commands.values()], axis=0)
    return Recording(
        path,
        t_s,
        measured["x"],
        measured["y"],
        heading,
        measured.get("mean_error", missing),
        cells.count(columns.frame),
        **commands,
        seen=seen,
        jumped=wild,
        driven=cells.flag(columns.driven) & known_command,
        cut=cells.stretches(columns.cut),
    )


def _time(cells: Cells) -> Floats:
    time = cells.mapping.columns.time
    if time.unit == ISO_8601:
        t_s = _seconds_since_1970(cells.text(time.column), cells.path)
    else:
        t_s = cells.number(time.column, factor(time.unit, TIME, cells.path))
    if np.isnan(t_s).any():
        row = int(np.argmax(np.isnan(t_s)))
        raise FileError(
            f"row {row + 1} has no {time.column}", where=cells.path, remedy="delete the row, or fill in its time"
        )
    back = np.flatnonzero(np.diff(t_s) < 0.0)
    if len(back):
        row, step = int(back[0]) + 2, t_s[back[0] + 1] - t_s[back[0]]
        remedy = "sort the rows by time, or split the file there"
        raise FileError(
            f"row {row}: {time.column} goes backwards", where=cells.path, value=f"{step:.6g} s", remedy=remedy
        )
    return t_s


def _seconds_since_1970(text: pa.ChunkedArray, path: Path) -> Floats:
    try:
        stamps = pc.if_else(pc.equal(text, ""), None, text).cast(pa.timestamp("ns", "UTC" if _has_zone(text) else None))
    except pa.ArrowException as error:
        remedy = "write times as 2024-09-25T07:50:18.28Z"
        raise FileError(f"time is not ISO 8601 ({str(error)[:100]})", where=path, remedy=remedy) from None
    return np.where(pc.is_null(stamps), np.nan, stamps.cast(pa.int64()).fill_null(0).to_numpy() * 1e-9)


def _has_zone(text: pa.ChunkedArray) -> bool:
    first = next((str(cell) for cell in text if cell.as_py()), "")
    return first.endswith("Z") or "+" in first or first.count("-") > 2


def _heading(cells: Cells) -> Floats:
    quaternion = cells.mapping.columns.quaternion
    assert quaternion is not None  # noqa: S101 - load_mapping makes sure that one of heading and quaternion is there
    parts = [cells.number(getattr(quaternion, part)) for part in "xyzw"]
    return heading_of(np.column_stack(parts), quaternion.forward, quaternion.floor_x, quaternion.floor_y)


def _commands(cells: Cells) -> dict[str, Floats]:
    """Return the commands by role; those of wheels as the speed and yaw rate of the body."""
    header = cells.mapping.header(cells.path)
    neutral = {name: np.full(len(cells.table), getattr(header.neutral, name)) for name in Command._fields}
    if (wheels := header.channels.wheels) is not None:
        body = wheels.body(*(_held(cells, name) for name in WheelCommand._fields))
        return neutral | dict(zip(("drive", "front"), body, strict=True))
    mapped = [name for name in Command._fields if getattr(cells.mapping.columns, name) is not None]
    return neutral | {name: _held(cells, name) for name in mapped}


def _held(cells: Cells, name: str) -> Floats:
    """Return a command column in which an empty cell repeats the one before."""
    signal = getattr(cells.mapping.columns, name)
    values = cells.number(signal.column, signal.scale, signal.offset)
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(last >= 0, values[last], np.nan)


Mask = NDArray[np.bool_]


class Cells:
    """The text of a CSV, and its columns as numbers and flags; errors name file, row and column."""

    def __init__(self, path: Path, mapping: Mapping) -> None:
        csv = mapping.csv
        self.path, self.mapping = path, mapping
        self.table: pa.Table = read_csv_text(
            path, delimiter=csv.delimiter, encoding=csv.encoding, skip_rows=csv.skip_rows
        )

    def text(self, column: str) -> pa.ChunkedArray:
        """Return a column as text."""
        if column not in self.table.column_names:
            names = ", ".join(name[:40] for name in self.table.column_names[:20])
            raise FileError(
                f"has no column {column!r} (it has {names})", where=self.path, remedy="correct the mapping's columns"
            )
        return self.table[column]

    def _typed(self, column: str, kind: Kind) -> NDArray[Any]:
        text = self.text(column)
        if self.mapping.csv.decimal == ",":
            text = pc.replace_substring(text, ",", ".")
        known = [ColumnSpec(column, kind, required=False)]
        typed = fill_columns(type_columns(pa.table({column: text}), known, self.path), known, self.path)
        values: NDArray[Any] = typed[column].to_numpy()
        return values

    def number(self, column: str, scale: float = 1.0, offset: float = 0.0) -> Floats:
        """Return a column as numbers, NaN where empty."""
        values = self._typed(column, "number")
        if np.isinf(values).any():
            row = int(np.argmax(np.isinf(values)))
            raise FileError(f"row {row + 1}: {column} is infinite", where=self.path, remedy="leave the cell empty")
        return values * scale + offset if (scale, offset) != (1.0, 0.0) else values

    def count(self, column: str | None) -> NDArray[np.int64]:
        """Return a column as whole numbers, −1 where empty."""
        return np.full(len(self.table), UNKNOWN_COUNT) if column is None else self._typed(column, "count")

    def flag(self, flag: Flag | None) -> Mask:
        """Return on which rows the flag's column equals its value: as numbers if both are, else as text."""
        if flag is None:
            return np.ones(len(self.table), np.bool_)
        if isinstance(flag.equals, bool | str):
            text = pc.utf8_lower(pc.utf8_trim_whitespace(self.text(flag.column)))
            equal: Mask = pc.equal(text, str(flag.equals).lower()).to_numpy()
            return equal
        return np.equal(self.number(flag.column), float(flag.equals))

    def stretches(self, column: str | None) -> NDArray[np.int64]:
        """Return for each row the number of the stretch in which a column keeps its value."""
        if column is None or not len(self.table):
            return np.zeros(len(self.table), np.int64)
        codes = self.text(column).combine_chunks().dictionary_encode().indices.to_numpy()
        return np.cumsum(np.diff(codes, prepend=codes[:1]) != 0)
