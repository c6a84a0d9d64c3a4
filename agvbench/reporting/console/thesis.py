"""The sections of ``agvbench thesis`` on the console."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext

from rich import box
from rich.console import Console, JustifyMethod
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from agvbench.thesis.section import Cell, ThesisSection, ThesisTable, show

# Longer words (names of choices) may break at the edge of a column.
_LONG_WORD = 13
_MIN_WIDTH = 100


def thesis_console() -> Console:
    """Return the terminal, or 100 columns where it has fewer: a wrapped line is better than a lost column."""
    console = Console()
    return console if console.width >= _MIN_WIDTH else Console(width=_MIN_WIDTH)


def with_progress(sections: Iterator[ThesisSection]) -> Iterator[ThesisSection]:
    """Yield the sections; while one is computed, a terminal shows on standard error that something goes on."""
    console = Console(stderr=True)
    while True:
        with console.status("refitting and predicting …") if console.is_terminal else nullcontext():
            section = next(sections, None)
        if section is None:
            return
        yield section


def print_section(section: ThesisSection, console: Console) -> None:
    """Print a section: its title, its findings, its tables."""
    console.rule(f"[bold]{escape(section.title)}")
    for finding in section.findings:
        console.print(Padding(f"• {escape(finding)}", (0, 0, 0, 1)), highlight=False)
    for table in section.tables:
        console.print()
        console.print(_rich_table(table))
        if table.note:
            console.print(Padding(escape(table.note), (0, 0, 0, 1)), style="dim", highlight=False)
    console.print()


def _rich_table(table: ThesisTable) -> Table:
    shown = Table(title=escape(table.title), title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    headings = table.narrow_columns or table.columns
    kept = [index for index, heading in enumerate(headings) if heading]
    for index in kept:
        numbers = any(_is_number(row[index]) for row in table.rows)
        justify: JustifyMethod = "right" if numbers else "left"
        shown.add_column(escape(headings[index]), justify=justify, overflow="fold", min_width=_width(table, index))
    for row in table.rows:
        shown.add_row(*(escape(show(row[index], table.digits)) for index in kept))
    return shown


def _width(table: ThesisTable, index: int) -> int:
    """Return the width below which a column's numbers, or its words of usual length, would break."""
    cells = [row[index] for row in table.rows]
    words = [len(word) for cell in cells for word in show(cell).split() if isinstance(cell, str)]
    numbers = [len(show(cell, table.digits)) for cell in cells if _is_number(cell)]
    return max([1, *numbers, *(length for length in words if length <= _LONG_WORD)])


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)
