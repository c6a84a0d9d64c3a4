"""The metrics of runs as a table, and the file ``errors.parquet`` in which a campaign keeps them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.atomic_files import write_atomically
from agvbench.campaign.manifest import MANIFEST_FILE, check_file, record
from agvbench.campaign.tables.parquet import read_parquet, to_parquet
from agvbench.errors import CampaignError, FileError, RecordingError
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import Metric
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.metrics.registry import all_metrics

if TYPE_CHECKING:
    import pandas as pd

FILE = "errors.parquet"
OF_RUN = ("run_id", "experiment", "trajectory", "condition", "repeat", "session", "firmware", "started_s", "status")
COLUMNS = (*OF_RUN, "metric", "value", "unit")
_METRIC = COLUMNS.index("metric")


def metric_table(campaign: Campaign | str | Path) -> pd.DataFrame:
    """Return the metrics of every run that has a target: one row for each run and metric.

    Columns: ``run_id``, ``experiment``, ``trajectory``, ``condition``, ``repeat``, ``session``, ``firmware``,
    ``started_s``, ``status`` as in the runs table; ``metric``, ``value`` and ``unit``. A metric that a run does not
    have (no planned path, nothing logged) has no row.

    Parameters
    ----------
    campaign
        A campaign, or its directory.

    Raises
    ------
    InputError
        If `campaign` is neither.
    CampaignError
        If the campaign cannot be read.
    FileError
        If a metric of the lab cannot be imported or evaluated.
    """
    opened = as_campaign(campaign)
    return metrics_of_runs(map(PlannedPaths(opened).measured, opened))


def metrics_of_runs(runs: Iterable[MeasuredRun], failures: dict[str, FileError] | None = None) -> pd.DataFrame:
    """Return what `metric_table` returns, of runs that were read already.

    With `failures`, a metric that cannot be evaluated has no row, and its first error is put there by its name.
    """
    import pandas as pd

    rows = [row for run in runs if run.target.is_finite for row in _rows(run, failures)]
    return pd.DataFrame([row for row in rows if row[_METRIC] not in (failures or {})], columns=list(COLUMNS))


def _rows(run: MeasuredRun, failures: dict[str, FileError] | None) -> Iterator[tuple[object, ...]]:
    named = [getattr(run, name) for name in OF_RUN]
    named[OF_RUN.index("session")] = run.session or ""
    for metric in all_metrics().values():
        if math.isfinite(value := _value(metric, run, failures)):
            yield (*named, metric.name, value, metric.unit)


def _value(metric: Metric, run: MeasuredRun, failures: dict[str, FileError] | None) -> float:
    """Return the number of a run, NaN where it has none; with `failures` also of a metric that fails or has failed."""
    if failures is None:
        return metric.of(run)
    if metric.name not in failures:
        try:
            return metric.of(run)
        except FileError as error:
            failures[metric.name] = error
    return math.nan


def write_metrics(directory: Path, table: pd.DataFrame) -> Path:
    """Write what `metric_table` returned as ``errors.parquet`` into a campaign directory; return the file.

    A campaign that lists hashes of its files lists that of this one, too. A file with the same content stays.

    Raises
    ------
    RecordingError
        If the disk refuses.
    """
    path = directory / FILE
    arrow = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    content = to_parquet(arrow)
    try:
        if path.exists() and path.read_bytes() == content:
            return path
        if (directory / MANIFEST_FILE).exists():
            record(directory, {FILE: content})
        else:
            write_atomically(path, content)
    except OSError as error:
        raise RecordingError("cannot be written", where=path, value=error.strerror) from None
    return path


def read_metrics(directory: Path) -> pd.DataFrame | None:
    """Return the table that lies in a campaign directory, or None where there is none.

    Raises
    ------
    CampaignError
        If it is damaged, or has other columns.
    """
    if not (directory / FILE).exists():
        return None
    frame: pd.DataFrame = read_columns(directory, COLUMNS).to_pandas()
    return frame


def read_columns(directory: Path, columns: Sequence[str], *, plain: bool = True) -> pa.Table:
    """Return these columns of the table that lies in a campaign directory; `plain` as in `read_parquet`.

    Raises
    ------
    CampaignError
        If the table is damaged, is not there, or lacks one of them.
    """
    path = directory / FILE
    check_file(directory, FILE)
    table = read_parquet(path, columns=columns, plain=plain)
    if missing := [name for name in columns if name not in table.column_names]:
        raise CampaignError(
            "is no table of metrics", where=path, value=f"no column {missing[0]}", remedy=remedy_for(path)
        )
    return table


def remedy_for(path: Path) -> str:
    """Return what to do about a table of metrics that cannot be used."""
    return f"delete it; agvbench report {path.parent} writes it again"


def by_run(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row per run with a column for each metric, NaN where the run does not have it.

    The other columns are those of the runs table, as in `metric_table`.
    """
    wide = table.pivot(index="run_id", columns="metric", values="value")
    runs = table.drop_duplicates("run_id")[list(OF_RUN)].set_index("run_id")
    joined = runs.join(wide).reset_index()
    return joined.rename_axis(columns=None)
