"""Free driving in the console: position errors by recording and predictor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

_PREDICTORS = {
    "static": "static maps",
    "speed_held": "speed held",
    "naive": "naive",
    "believed": "believed",
    "after": "after",
}
_MOST_ROWS = 24


def windows_table(windows: Mapping[str, Any]) -> Table:
    """Return position errors [mm] by recording, those held out first, with 95 % intervals where they are known."""
    rows = sorted(windows["recordings"], key=lambda row: not row["held_out"])[:_MOST_ROWS]
    known = [name for name in _PREDICTORS if f"{name}_mm" in _errors(rows[0])[0][1]]
    table = Table(title="position error by recording, mm", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("recording", "ahead", "floor", *(_PREDICTORS[name] for name in known)):
        table.add_column(heading, justify="left" if heading == "recording" else "right")
    for row in rows:
        label = f"{row['recording']}{' (held out)' if row['held_out'] else ''}"
        for ahead, errors in _errors(row):
            cells = [_cell(errors[f"{name}_mm"]) for name in known]
            table.add_row(Text(label), ahead, f"{errors['floor_mm']:.1f}", *cells)
            label = ""
    return table


def _errors(row: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    return [
        (key.removeprefix("ahead_").replace("_", " "), value) for key, value in row.items() if key.startswith("ahead_")
    ]


def _cell(error: Mapping[str, float]) -> str:
    interval = "" if math.isnan(error["low"]) else f" ({error['low']:.0f}…{error['high']:.0f})"
    return f"{error['rms']:.0f}{interval}"
