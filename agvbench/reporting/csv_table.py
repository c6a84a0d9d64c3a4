"""Tables as CSV: full precision, one header line, safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io
import math
import unicodedata
from typing import TYPE_CHECKING

from agvbench.reporting.content import Table, Value, plain

if TYPE_CHECKING:
    import pandas as pd


def to_csv(table: Table) -> str:
    """Return `table` as CSV (UTF-8, comma, point)."""
    return _csv([column.name for column in table.columns], [list(row) for row in table.rows])


def frame_to_csv(frame: pd.DataFrame) -> str:
    """Return a data frame as CSV in the same form."""
    return _csv([str(name) for name in frame.columns], frame.to_numpy(dtype=object).tolist())


def _csv(header: list[str], rows: list[list[Value]]) -> str:
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([_cell(name) for name in header])
    writer.writerows([_cell(value) for value in row] for row in rows)
    return file.getvalue()


def _cell(value: Value) -> Value:
    """Return the value; text that a spreadsheet would take for a formula gets an apostrophe before it."""
    if isinstance(value, float) and math.isnan(value):
        return ""
    if not isinstance(value, str):
        return value
    text = plain(value)
    # Spreadsheets may read full-width and superscript signs as the ASCII ones.
    return f"'{text}" if unicodedata.normalize("NFKC", text[:1]) in {"=", "+", "-", "@"} else text
