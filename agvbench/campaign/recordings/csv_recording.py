"""Read one foreign CSV as its mapping declares: SI, radians, the floor frame, commands held until the next."""

from __future__ import annotations

from collections.abc import Mapping as Named
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from agvbench.campaign.recordings.mapping import ISO_8601, TIME, Flag, Mapping, Signal, factor, quantities
from agvbench.campaign.recordings.recording import Mask, Poses, Recording, combine
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.campaign.tables.schema import UNKNOWN_COUNT, ColumnSpec, Kind, fill_columns, type_columns
from agvbench.errors import FileError
from agvbench.types import Floats, TimeSeries
from agvbench.vehicle.quaternion import heading_of


def read_csv_recording(path: Path, mapping: Mapping) -> Recording:
    """Read poses and commands from the CSV `path`.

    Raises
    ------
    FileError
        If the file or a mapped column is missing, or time goes backwards.
    CampaignError
        If a cell is not a number.
    """
    cells = Cells(path, mapping)
    columns = mapping.columns
    t_s = cells.time()
    measured = {
        name: cells.number(q.column, factor(q.unit, known, path) * q.scale, q.offset)
        for name, q, known in quantities(mapping)
    }
    poses = Poses(
        t_s,
        measured["x"],
        measured["y"],
        measured["heading"] if "heading" in measured else _heading(cells),
        measured.get("mean_error", np.full(len(t_s), np.nan)),
        cells.count(columns.frame),
    )
    flags = {name: cells.flag(flag) for name, flag in mapping.flags.items()}
    commands, logged = cells.series(mapping.commands, t_s), cells.series(mapping.logged, t_s)
    return combine(path, (path,), mapping, poses, commands, flags, cells.stretches(columns.cut), logged=logged)


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
                f"has no column {column[:40]!r} (it has {names})",
                where=self.path,
                remedy="correct the mapping's columns",
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
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is infinite, and refused
            scaled = values * scale + offset if (scale, offset) != (1.0, 0.0) else values
        if np.isinf(scaled).any():
            row = int(np.argmax(np.isinf(scaled)))
            raise FileError(f"row {row + 1}: {column} is infinite", where=self.path, remedy="leave the cell empty")
        return scaled

    def count(self, column: str | None) -> NDArray[np.int64]:
        """Return a column as whole numbers, −1 where empty."""
        return np.full(len(self.table), UNKNOWN_COUNT) if column is None else self._typed(column, "count")

    def time(self) -> Floats:
        """Return the time of each row [s], in order."""
        time = self.mapping.columns.time
        assert time is not None  # noqa: S101 - load_mapping makes sure of it
        if time.unit == ISO_8601:
            t_s = _seconds_since_1970(self.text(time.column), self.path)
        else:
            t_s = self.number(time.column, factor(time.unit, TIME, self.path))
        if np.isnan(t_s).any():
            row = int(np.argmax(np.isnan(t_s)))
            raise FileError(
                f"row {row + 1} has no {time.column}", where=self.path, remedy="delete the row, or fill in its time"
            )
        back = np.flatnonzero(np.diff(t_s) < 0.0)
        if len(back):
            row, step = int(back[0]) + 2, t_s[back[0] + 1] - t_s[back[0]]
            remedy = "sort the rows by time, or split the file there"
            raise FileError(
                f"row {row}: {time.column} goes backwards", where=self.path, value=f"{step:.6g} s", remedy=remedy
            )
        return t_s

    def series(self, signals: Named[str, Signal], t_s: Floats) -> dict[str, TimeSeries]:
        """Return the values of `signals` by name, given at `t_s`; an empty cell repeats the one before."""
        found = {}
        for name, signal in signals.items():
            values = self.number(signal.column, signal.scale, signal.offset)
            given = np.isfinite(values)
            found[name] = TimeSeries(t_s[given], values[given])
        return found

    def flag(self, flag: Flag) -> Mask:
        """Return on which rows the flag's column equals its value: as numbers if both are, else as text."""
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
