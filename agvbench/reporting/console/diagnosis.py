"""A diagnosis on the console: the answer in plain words, and the errors before and after."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agvbench.diagnosis import Diagnosis
from agvbench.diagnosis.result import HeldOut
from agvbench.workflows.diagnosis_files import (
    COLUMNS,
    DEFINITIONS,
    QUANTITIES,
    effect_in_words,
    extrapolation_in_words,
    fit_in_words,
    left_in_words,
    next_in_words,
    remedies_in_words,
    sessions_in_words,
    states_in_words,
)

_MOST_DEPENDENCES = 5


def print_diagnosis(found: Diagnosis, console: Console) -> None:
    """Print the answer in plain words."""
    content = found.to_json()
    console.print(Text.assemble((str(found.verdict), "bold"), f": {found.why}"), soft_wrap=True)
    lines = [*map(effect_in_words, found.effects), *islice(left_in_words(content), _MOST_DEPENDENCES)]
    _say(lines, console)
    if found.held_out is not None:
        console.print()
        runs = found.held_out.runs
        console.print(f"Prediction errors of {runs} test runs, root mean squares but for the median:", highlight=False)
        console.print(errors_table(found.held_out))
        console.print(Text(DEFINITIONS, style="dim"))
        _say(fit_in_words(content), console)
        if windows := found.provenance.get("windows"):
            console.print(windows_table(windows))
        _say((*extrapolation_in_words(content), *sessions_in_words(content)), console)
        if found.held_out.worse_on:
            _say([f"Worse than before on: {', '.join(found.held_out.worse_on)}."], console)
    _say((*states_in_words(content), *remedies_in_words(content), *next_in_words(content)), console)


def _say(lines: Iterable[str], console: Console) -> None:
    for line in lines:
        console.print(f"  {line}", highlight=False, markup=False, soft_wrap=True)


def errors_table(held: HeldOut) -> Table:
    """Return errors before and after beside the spread of repeats."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("")
    known = {key: heading for key, heading in COLUMNS.items() if any(key in errors for errors in held.errors.values())}
    for heading in known.values():
        # Folded, so that the table fits 80 columns.
        table.add_column(heading.replace("reproducibility", "reproduci-\nbility"), justify="right")
    for name, title in QUANTITIES.items():
        if errors := held.errors.get(name):
            table.add_row(Text(title), *(f"{errors[key]:.2f}" for key in known))
    return table


_PREDICTORS = {
    "static": "static maps",
    "speed_held": "speed held",
    "naive": "constant velocity",
    "believed": "nominal",
    "after": "after",
}
_PARTS = ("within", "beyond")
_CAPTION = "within, beyond: (number of) windows with commands within and beyond the range of the training windows"
_MOST_ROWS = 24


def windows_table(windows: Mapping[str, Any]) -> Table:
    """Return position errors [mm] by recording, the test recordings first, with 95 % intervals where they are known."""
    rows = sorted(windows["recordings"], key=lambda row: not row["held_out"])[:_MOST_ROWS]
    known = [name for name in _PREDICTORS if f"{name}_mm" in _errors(rows[0])[0][1]]
    table = Table(title="position error by recording, mm", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("recording", "ahead", "floor", *(_PREDICTORS[name] for name in known)):
        table.add_column(heading, justify="left" if heading == "recording" else "right")
    if any("beyond" in row for row in rows):
        table.caption, table.caption_justify = _CAPTION, "left"
    for row in rows:
        label = f"{row['recording']}{' (test)' if row['held_out'] else ''}"
        parts = {f"  {key} ({row[key]['windows']})": row[key] for key in _PARTS if key in row}
        for title, part in {label: row, **parts}.items():
            for k, (ahead, errors) in enumerate(_errors(part)):
                cells = [_cell(errors[f"{name}_mm"]) for name in known]
                table.add_row(Text("" if k else title), ahead, f"{errors['floor_mm']:.1f}", *cells)
    return table


def _errors(row: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    return [
        (key.removeprefix("ahead_").replace("_", " "), value) for key, value in row.items() if key.startswith("ahead_")
    ]


def _cell(error: Mapping[str, float]) -> str:
    interval = "" if math.isnan(error["low"]) else f" ({error['low']:.0f}…{error['high']:.0f})"
    return f"{error['rms']:.0f}{interval}"
