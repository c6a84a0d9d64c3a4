"""A sweep on the console: the cells with the smallest and the largest errors, failures, and the files written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from agvbench.reporting.console.tables import console_table
from agvbench.reporting.content import Column, Table, Value
from agvbench.workflows.sweep import SweepResult
from agvbench.workflows.sweep.grid import Grid
from agvbench.workflows.sweep.results import incomplete_cells, ranked_cells
from agvbench.workflows.sweep.run import first_command

if TYPE_CHECKING:
    import pandas as pd

_SHOWN = 5
_FAILED_SHOWN = 10


def print_sweep(console: Console, result: SweepResult) -> None:
    """Print what a sweep found."""
    ranked = ranked_cells(result.directory, result.grid)
    ends = ranked if len(ranked) <= 2 * _SHOWN else None
    if ends is not None:
        _print_cells(console, "cells by median end position error (mm)", result.grid, ends)
    else:
        _print_cells(console, "smallest median end position errors (mm)", result.grid, ranked.head(_SHOWN))
        _print_cells(console, "largest median end position errors (mm)", result.grid, ranked.tail(_SHOWN))
    failed = list(result.failed.items())
    for cell, cause in failed[:_FAILED_SHOWN]:
        console.print(Text(f"failed: cell {cell} ({_named(result.grid, cell)}): {cause}", style="red"), soft_wrap=True)
    if len(failed) > _FAILED_SHOWN:
        console.print(Text(f"failed: {len(failed) - _FAILED_SHOWN} more cells (see cells.jsonl)", style="red"))
    total, incomplete = len(result.grid), incomplete_cells(result.directory)
    if incomplete:
        console.print(Text(f"incomplete: {incomplete} cells have runs that failed (column complete)", style="yellow"))
    console.print(Text(f"{total - len(failed)} of {total} cells have a result", style="bold"))
    console.print(Text(f"wrote {result.parquet} and {result.csv}"), soft_wrap=True)


def print_plan(console: Console, grid: Grid) -> None:
    """Print which cells a sweep would drive."""
    columns = [
        Column("axis", "axis"), Column("values", "values", 0), Column("first", "first"), Column("last", "last")
    ]  # fmt: skip
    rows = [(axis.name, len(axis.values), str(axis.values[0]), str(axis.values[-1])) for axis in grid.axes]
    console.print(console_table(Table("cells", f"{len(grid)} cells", columns, rows)))
    console.print(Text(f"cell 0: {first_command(grid)}"), soft_wrap=True)


def _print_cells(console: Console, caption: str, grid: Grid, cells: pd.DataFrame) -> None:
    names = [axis.name for axis in grid.axes]
    axes = [Column(name, name) for name in names]
    conditions = list(cells.columns[2 + len(names) :])
    medians = [Column(name, name, 1) for name in conditions]
    columns = [Column("cell", "cell", 0), *axes, Column("n", "n", 0), *medians]
    rows: list[list[Value]] = [
        [int(row["cell"]), *(str(row[name]) for name in names), int(row["n"]), *(float(row[c]) for c in conditions)]
        for row in cells.to_dict("records")
    ]
    if rows:
        console.print(console_table(Table("ranked", caption, columns, rows)))


def _named(grid: Grid, cell: int) -> str:
    return ", ".join(f"{a.name}={v}" for a, v in zip(grid.axes, grid.values(cell), strict=True))
