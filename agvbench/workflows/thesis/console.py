"""Sections on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.workflows.thesis.layout import Cell, Section, Table, show

if TYPE_CHECKING:
    import rich.table
    from rich.console import Console


def print_section(section: Section, console: Console) -> None:
    """Print a section: its title, its findings, its tables."""
    from rich.markup import escape
    from rich.padding import Padding

    console.rule(f"[bold]{escape(section.title)}")
    for finding in section.findings:
        console.print(Padding(f"• {escape(finding)}", (0, 0, 0, 1)), highlight=False)
    for table in section.tables:
        console.print()
        console.print(_rich_table(table))
    console.print()


def _rich_table(table: Table) -> rich.table.Table:
    import rich.table
    from rich.markup import escape

    shown = rich.table.Table(title=escape(table.title), caption=escape(table.note) or None, title_justify="left")
    for index, column in enumerate(table.columns):
        numbers = any(_is_number(row[index]) for row in table.rows)
        shown.add_column(escape(column), justify="right" if numbers else "left", overflow="fold")
    for row in table.rows:
        shown.add_row(*(escape(show(cell)) for cell in row))
    return shown


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)
