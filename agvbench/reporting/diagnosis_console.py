"""A diagnosis on the console: the answer in plain words, and the errors before and after."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agvbench.diagnosis import Diagnosis
from agvbench.diagnosis.result import HeldOut
from agvbench.reporting.windows_table import windows_table
from agvbench.workflows.diagnosis_files import (
    COLUMNS,
    DEFINITIONS,
    QUANTITIES,
    effect_in_words,
    left_in_words,
    next_in_words,
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
        console.print(
            f"Prediction errors of {runs} runs held out, root mean squares but for the median:", highlight=False
        )
        console.print(errors_table(found.held_out))
        console.print(Text(DEFINITIONS, style="dim"))
        if windows := found.provenance.get("windows"):
            console.print(windows_table(windows))
        if found.held_out.worse_on:
            _say([f"Worse than before on: {', '.join(found.held_out.worse_on)}."], console)
    _say(next_in_words(content), console)


def _say(lines: Iterable[str], console: Console) -> None:
    for line in lines:
        console.print(f"  {line}", highlight=False, markup=False, soft_wrap=True)


def errors_table(held: HeldOut) -> Table:
    """Return errors before and after beside the repeatability."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("")
    for heading in COLUMNS.values():
        table.add_column(heading, justify="right")
    for name, title in QUANTITIES.items():
        if errors := held.errors.get(name):
            table.add_row(Text(title), *(f"{errors[column]:.2f}" for column in COLUMNS))
    return table
