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
from agvbench.reporting.errors_by_recording import PARTS, PREDICTORS, known_predictors, recorded_errors
from agvbench.workflows.diagnosis_files import (
    COLUMNS,
    DEFINITIONS,
    QUANTITIES,
    effect_in_words,
    extrapolation_in_words,
    fit_in_words,
    left_in_words,
    logged_in_words,
    next_in_words,
    remedies_in_words,
    sessions_in_words,
    states_in_words,
    term_in_words,
)

_MOST_DEPENDENCES = 5


def print_diagnosis(found: Diagnosis, console: Console) -> None:
    """Print the answer in plain words."""
    content = found.to_json()
    console.print(Text.assemble((str(found.verdict), "bold"), f": {found.why}"), soft_wrap=True)
    left = islice(left_in_words(content), _MOST_DEPENDENCES)
    lines = [*map(effect_in_words, found.effects), *left, *term_in_words(content)]
    _say(lines, console)
    if found.held_out is not None:
        console.print()
        runs = found.held_out.runs
        console.print(f"Prediction errors of {runs} test runs, root mean squares but for the median:", highlight=False)
        console.print(errors_table(found.held_out))
        console.print(Text(DEFINITIONS, style="dim"))
        _say(fit_in_words(content), console)
        if found.provenance.get("windows"):
            console.print(windows_table(content))
        _say((*extrapolation_in_words(content), *sessions_in_words(content)), console)
        _say(logged_in_words(content), console)
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


def windows_table(content: Mapping[str, Any]) -> Table:
    """Return position errors [mm] by recording, the test recordings first; of the model, with 95 % intervals.

    The report has the intervals of every predictor, for which 80 columns have no room.
    """
    rows = recorded_errors(content)
    known = known_predictors(rows)
    table = Table(
        title="position error by recording, mm", box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0)
    )
    table.add_column("recording", overflow="fold")
    for heading in ("ahead", "floor", *(PREDICTORS[name] for name in known[:-1])):
        table.add_column(heading, justify="right", max_width=8)
    table.add_column(PREDICTORS[known[-1]], justify="right", no_wrap=True)
    if any(row.part for row in rows):
        table.caption, table.caption_justify = PARTS, "left"
    before = ""
    for row in rows:
        cells = [f"{row.error_mm(name)[0]:.0f}" for name in known[:-1]] + [_cell(*row.error_mm(known[-1]))]
        label = f"{row.recording}{row.title}"
        table.add_row(Text("" if label == before else row.title), row.ahead, f"{row.floor_mm:.1f}", *cells)
        before = label
    return table


def _cell(rms: float, low: float, high: float) -> str:
    return f"{rms:.0f}" + ("" if math.isnan(low) else f" ({low:.0f}…{high:.0f})")
