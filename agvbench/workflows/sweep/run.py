"""``agvbench sweep``: drive every cell of a grid, and write one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.campaign.atomic_files import write_atomically
from agvbench.campaign.lock import locked
from agvbench.campaign.writer import refuse_occupied
from agvbench.errors import FlagError
from agvbench.executors import Executor, ExecutorOptions, Failed, Outcome, Task, check_address, open_executor
from agvbench.running.configuration.session_options import as_flag
from agvbench.workflows.sweep.cell import CellRequest, CellResult, drive_cell
from agvbench.workflows.sweep.grid import Grid, read_grid
from agvbench.workflows.sweep.lab_files import LabFiles
from agvbench.workflows.sweep.results import read_results, write_results
from agvbench.workflows.sweep.store import CellStore, Line, header

if TYPE_CHECKING:
    import pandas as pd

GRID_FILE, CAMPAIGNS = "grid.toml", "campaigns"
Outcomes = Iterator[Outcome[int, CellResult]]
Track = Callable[[Iterable[Any], int], Iterable[Any]]


@dataclass(frozen=True)
class SweepResult:
    """What a sweep wrote, and which cells failed, each with its cause."""

    grid: Grid
    directory: Path
    parquet: Path
    csv: Path
    failed: Mapping[int, str]


def sweep(
    grid: str | Path,
    out: str | Path,
    *,
    jobs: int | None = None,
    cluster: str = "",
    resume: bool = False,
    keep: bool = False,
    diagnose: bool = False,
) -> pd.DataFrame:
    """Drive a bench session for every cell of a grid; return the table of their results.

    Parameters
    ----------
    grid
        A TOML file, as ``agvbench sweep --help`` describes it.
    out
        The directory of the sweep: a new one, or with `resume` the one that it began in.
    jobs
        Cells at a time on this machine; None for one per processor.
    cluster
        Address of a Dask scheduler whose workers drive the cells, instead of processes of this machine.
    keep
        Keep the campaign of each cell in ``campaigns/``.
    diagnose
        Diagnose each campaign, for the columns ``verdict`` and ``named``.

    Returns
    -------
    pandas.DataFrame
        A row for each cell, trajectory and condition (`agvbench.workflows.sweep.results.write_results`). Cells that
        failed have none; ``frame.attrs["failed"]`` holds their causes by cell.

    Raises
    ------
    AgvbenchError
        If the grid, the directory or the cluster cannot be used.
    """
    options = ExecutorOptions(cluster, jobs=jobs)
    result = run_sweep(Path(grid), Path(out), options, resume=resume, keep=keep, diagnose=diagnose)
    frame = read_results(result.directory)
    frame.attrs["failed"] = dict(result.failed)
    return frame


def run_sweep(
    grid_file: Path,
    out: Path,
    executor_options: ExecutorOptions,
    *,
    resume: bool = False,
    keep: bool = False,
    diagnose: bool = False,
    track: Track = lambda items, total: items,
) -> SweepResult:
    """Drive the cells that the directory `out` lacks, and write the results.

    A cell is on the disk when it has ended: an interruption loses those in flight only. Cells that failed before are
    driven again. `track` shows how many of a number of cells have ended.

    Raises
    ------
    AgvbenchError
        If the grid, the directory or the cluster cannot be used. What is recorded stays.
    """
    grid = read_grid(grid_file)
    check_address(executor_options)
    lab = LabFiles.of(grid, Path.cwd())
    first = header(grid.digest, lab.sha256 if lab else "", diagnose=diagnose)
    if not resume:
        refuse_occupied(out, "add --resume, or choose another directory")
    elif not out.is_dir():
        raise FlagError("no sweep to resume", where="--resume --out", value=out, remedy="leave out --resume")
    with locked(out):
        store = CellStore.resume(out, first, len(grid)) if resume else CellStore.create(out, first)
        with closing(store):
            if not resume:
                write_atomically(out / GRID_FILE, grid_file.read_bytes())
            missing = [cell for cell in range(len(grid)) if cell not in store.places]
            if missing:
                requests = _requests(grid, missing, lab, (out.absolute() / CAMPAIGNS) if keep else None, diagnose)
                with open_executor(executor_options) as executor:
                    _record(store, track(_outcomes(executor, requests), len(missing)), len(grid))
            parquet, csv = write_results(out, grid, store, diagnose=diagnose)
            return SweepResult(grid, out, parquet, csv, dict(sorted(store.failed.items())))


def _requests(
    grid: Grid, cells: Iterable[int], lab: LabFiles | None, campaigns: Path | None, diagnose: bool
) -> Iterator[tuple[int, CellRequest]]:
    for cell in cells:
        keep = str(campaigns / f"{cell:07d}") if campaigns else ""
        yield cell, CellRequest(grid.benchmarks, flags(grid.options(cell)), lab, keep, diagnose)


def _outcomes(executor: Executor, requests: Iterator[tuple[int, CellRequest]]) -> Outcomes:
    return executor.run((Task(cell, drive_cell, (request,)) for cell, request in requests), CellResult)


def _record(store: CellStore, outcomes: Iterable[Outcome[int, CellResult]], total: int) -> None:
    """Append a line for each outcome as it comes."""
    try:
        for outcome in outcomes:
            if isinstance(outcome, Failed):
                store.add(Line(outcome.key, error=outcome.cause))
            else:
                store.add(Line(outcome.key, outcome.result))
    except KeyboardInterrupt as interrupt:
        interrupt.args = (f"{len(store.places)} of {total} cells are recorded; go on with --resume",)
        raise


def flags(options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the flags of ``agvbench bench`` for options of a cell.

    >>> flags({"seed": 3, "full": True, "plant_option": "backlash_m=0.01"})
    ('--seed=3', '--full', '--plant-option=backlash_m=0.01')
    """
    return tuple(text for name, value in options.items() for text in as_flag(f"--{name.replace('_', '-')}", value))


def first_command(grid: Grid) -> str:
    """Return the command that drives the first cell alone."""
    return " ".join(["agvbench bench", *grid.benchmarks, *flags(grid.options(0))])
