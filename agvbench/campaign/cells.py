"""The cells of a foreign CSV, column by column."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from agvbench.campaign.columns import UNKNOWN_COUNT, fill_columns, type_columns
from agvbench.campaign.csv_text import read_csv_text
from agvbench.campaign.mapping_schema import Flag, Mapping
from agvbench.campaign.schema import Column, Kind
from agvbench.errors import FileError
from agvbench.types import Floats

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
        known = [Column(column, kind, required=False)]
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
