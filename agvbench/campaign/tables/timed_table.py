"""Tables of timed rows (commands or poses), grouped by run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from agvbench.campaign.tables.schema import UNKNOWN_COUNT
from agvbench.errors import CampaignError
from agvbench.types import Floats


class TimedTable:
    """The rows of `table` in the order of `run_ids`, and within a run in the order they were written.

    Raises
    ------
    CampaignError
        If one file holds rows of an unknown run. In a directory of parts these belong to a run that was
        interrupted before it was finished: they are left out.
    """

    def __init__(self, path: Path, table: pa.Table, run_ids: Sequence[str], *, in_parts: bool) -> None:
        self.path = path
        self.run_ids = run_ids
        codes = pc.index_in(table["run_id"], value_set=pa.array(run_ids, pa.string())).fill_null(-1).to_numpy()
        unknown = codes < 0
        if unknown.any() and not in_parts:
            row = int(np.argmax(unknown))
            raise CampaignError(
                f"row {row + 1} belongs to a run that runs does not list",
                where=path,
                value=table["run_id"][row].as_py(),
                remedy="add the run to runs, or delete its rows",
            )
        if unknown.any() or np.any(np.diff(codes) < 0):
            order = np.argsort(codes, kind="stable")[np.count_nonzero(unknown) :]
            table, codes = table.take(pa.array(order)), codes[order]
        self.table = table
        self.run_of_row: NDArray[np.int64] = codes
        self.offsets: NDArray[np.int64] = np.searchsorted(codes, np.arange(len(run_ids) + 1))
        self._columns: dict[str, NDArray[Any]] = {}

    @property
    def counts(self) -> NDArray[np.int64]:
        """Rows of each run, shape (runs,)."""
        return np.diff(self.offsets)

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """The first row of each run that has rows."""
        return self.offsets[:-1][self.counts > 0]

    def column(self, name: str) -> NDArray[Any]:
        """Return a column as an array, shape (rows,); an optional column that is absent is −1 or NaN throughout."""
        if name not in self._columns:
            known = name in self.table.column_names
            self._columns[name] = self.table[name].to_numpy() if known else self._unknown(name)
        return self._columns[name]

    def _unknown(self, name: str) -> NDArray[Any]:
        return np.full(self.table.num_rows, UNKNOWN_COUNT if name == "frame" else np.nan)

    def last(self, name: str) -> Floats:
        """Return the last value of a column in each run, shape (runs,); 0 for a run without rows."""
        last = np.zeros(len(self.run_ids))
        has = self.counts > 0
        last[has] = self.column(name)[self.offsets[1:][has] - 1]
        return last

    def first(self, name: str) -> Floats:
        """Return the first value of a column in each run, shape (runs,); 0 for a run without rows."""
        first = np.zeros(len(self.run_ids))
        first[self.counts > 0] = self.column(name)[self.starts]
        return first

    def shift(self, by_s: Floats) -> None:
        """Subtract `by_s` (runs,) from the times of each run: when a row was measured, and when it was received."""
        for name in ("t_s", "received_s") if by_s.any() else ():
            if name in self.table.column_names:
                times = self.column(name) - by_s[self.run_of_row]
                self.table = self.table.set_column(self.table.column_names.index(name), name, pa.array(times))
                self._columns[name] = times

    def rows(self, index: int) -> slice:
        """Return the rows of run number `index`."""
        return slice(int(self.offsets[index]), int(self.offsets[index + 1]))

    def place(self, row: int) -> str:
        """Name a row as a person would: file, run, and row within the run (the first is 1)."""
        run = int(self.run_of_row[row])
        return f"{self.path}: run {self.run_ids[run]}: row {row - int(self.offsets[run]) + 1}"


def blank_untracked(table: pa.Table) -> pa.Table:
    """Give both signs of a lost frame, NaN and tracked = false, to every lost frame."""
    names = ("x_m", "y_m", "heading_rad")
    seen = table["tracked"]
    for name in names:
        seen = pc.and_(seen, pc.invert(pc.is_nan(table[name])))
    if pc.all(seen).as_py() is not False:
        return table
    for name in names:
        table = table.set_column(table.column_names.index(name), name, pc.if_else(seen, table[name], np.nan))
    return table.set_column(table.column_names.index("tracked"), "tracked", seen)
