"""``results.parquet`` and ``results.csv``: a row for each cell, trajectory and condition, in the order of cells.

The bytes depend on the grid and the results alone: not on where cells were driven, nor on which ended first. Rows are
written in groups, so that a million cells do not have to be in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from agvbench.campaign.atomic_files import replace_whole
from agvbench.errors import RecordingError
from agvbench.statistics.end_poses import in_order
from agvbench.workflows.sweep.axes import OPTIONS, Axis, as_text
from agvbench.workflows.sweep.cell import CellResult, Row
from agvbench.workflows.sweep.grid import Grid
from agvbench.workflows.sweep.store import CellStore

if TYPE_CHECKING:
    import pandas as pd

PARQUET, CSV = "results.parquet", "results.csv"
ERROR = "position_error_mm"
_ROWS = 20_000
_KINDS = {"int": pa.int64(), "float": pa.float64(), "bool": pa.bool_(), "str": pa.string()}
_NO_ROW = Row("", "", 0, {})


def write_results(directory: Path, grid: Grid, store: CellStore, *, diagnose: bool) -> tuple[Path, Path]:
    """Write both tables; each is replaced by a whole one.

    Columns: ``cell``; a column for each axis; ``trajectory``, ``condition``, ``n`` (runs that count), ``complete`` (all
    runs were valid); the median magnitude of each metric over these runs, its unit in the name; ``verdict`` and
    ``named`` with `diagnose`; ``sha256`` of the cell's ``errors.parquet``.

    Raises
    ------
    RecordingError
        If the disk refuses.
    """
    metrics = sorted({name for _, result in store.results() for row in result.rows for name in row.medians})
    schema = _schema(grid, metrics, diagnose=diagnose)

    def parquet(path: Path) -> None:
        with pq.ParquetWriter(path, schema, compression="zstd", write_statistics=False, store_schema=False) as writer:
            for batch in _batches(grid, store, schema):
                writer.write_batch(batch)

    def csv(path: Path) -> None:
        with pyarrow.csv.CSVWriter(path, schema) as writer:
            for batch in _batches(grid, store, schema):
                writer.write_batch(batch)

    paths = directory / PARQUET, directory / CSV
    for path, write in zip(paths, (parquet, csv), strict=True):
        try:
            replace_whole(path, write)
        except OSError as error:
            raise RecordingError("cannot be written", where=path, value=error.strerror) from None
    return paths


def _schema(grid: Grid, metrics: Iterable[str], *, diagnose: bool) -> pa.Schema:
    fields = [("cell", pa.int64()), *((axis.name, _kind(axis)) for axis in grid.axes)]
    fields += [("trajectory", pa.string()), ("condition", pa.string()), ("n", pa.int64()), ("complete", pa.bool_())]
    fields += [(name, pa.float64()) for name in metrics]
    fields += [("verdict", pa.string()), ("named", pa.string())] if diagnose else []
    return pa.schema([*fields, ("sha256", pa.string())])


def _kind(axis: Axis) -> pa.DataType:
    """Return the type of an axis' column; parameters have the narrowest that holds all their values."""
    if not axis.parameter:
        return _KINDS[OPTIONS[axis.option]]
    kinds = {int} if isinstance(axis.values, range) else {type(value) for value in axis.values}
    for known, kind in (({int}, pa.int64()), ({int, float}, pa.float64()), ({bool}, pa.bool_())):
        if kinds <= known:
            return kind
    return pa.string()


def _batches(grid: Grid, store: CellStore, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    rows: list[dict[str, Any]] = []
    for cell, result in store.results():
        rows += _rows(grid, cell, result, schema)
        if len(rows) >= _ROWS:
            yield pa.RecordBatch.from_pylist(rows, schema)
            rows = []
    if rows:
        yield pa.RecordBatch.from_pylist(rows, schema)


def _rows(grid: Grid, cell: int, result: CellResult, schema: pa.Schema) -> Iterator[dict[str, Any]]:
    shared: dict[str, Any] = {"cell": cell, "complete": result.is_complete, "sha256": result.sha256}
    for axis, value in zip(grid.axes, grid.values(cell), strict=True):
        is_text = schema.field(axis.name).type == pa.string()
        shared[axis.name] = as_text(value) if is_text else value
    shared |= {"verdict": result.verdict, "named": ", ".join(result.named)}
    for row in result.rows or (_NO_ROW,):
        yield {**shared, "trajectory": row.trajectory, "condition": row.condition, "n": row.n, **row.medians}


def read_results(directory: Path) -> pd.DataFrame:
    """Return the table of a sweep."""
    frame: pd.DataFrame = pq.read_table(directory / PARQUET).to_pandas()
    return frame


def ranked_cells(directory: Path, grid: Grid) -> pd.DataFrame:
    """Return the median end position error [mm] of each cell over its trajectories, for each condition.

    Columns: ``cell``, a column for each axis, ``n``, and one for each condition in their usual order; the smallest
    under the last condition comes first. Cells without an end position error are left out.
    """
    import pandas as pd

    names = [axis.name for axis in grid.axes]
    known = set(pq.read_schema(directory / PARQUET).names)
    if ERROR not in known:
        return pd.DataFrame(columns=["cell", *names, "n"])
    frame = pq.read_table(directory / PARQUET, columns=["cell", *names, "condition", "n", ERROR]).to_pandas()
    frame = frame.dropna(subset=[ERROR])
    cells = frame.groupby("cell").agg({**dict.fromkeys(names, "first"), "n": "sum"})
    conditions = in_order(frame["condition"])
    medians = frame.pivot_table(index="cell", columns="condition", values=ERROR, aggfunc="median")[conditions]
    ranked: pd.DataFrame = cells.join(medians).reset_index()
    return ranked.sort_values([*reversed(conditions), "cell"], ignore_index=True)


def incomplete_cells(directory: Path) -> int:
    """Return how many cells have runs that were never driven well enough."""
    frame = pq.read_table(directory / PARQUET, columns=["cell", "complete"]).to_pandas()
    return int(frame.loc[~frame["complete"].astype(bool), "cell"].nunique())
