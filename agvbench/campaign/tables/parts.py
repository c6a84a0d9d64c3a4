"""A run as the parts of the three tables, and the names of these parts."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote, unquote

import numpy as np
import pyarrow as pa

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.tables.command_columns import file_columns
from agvbench.errors import CampaignError
from agvbench.types import Run

_SUFFIX = ".parquet"
_LONGEST_NAME = 200


def part_name(run_id: str) -> str:
    """Return the file name of a run's parts: its id, with what file names cannot hold as %XX.

    Raise `CampaignError` if the id is empty or too long for a file name.

    >>> part_name("drive/1500 us")
    'drive%2F1500%20us.parquet'
    """
    name = quote(run_id, safe="")
    name = name.replace(".", "%2E", 1) if name.startswith(".") else name
    if not name or len(name) > _LONGEST_NAME:
        raise CampaignError(
            "run_id cannot name a file", value=repr(run_id[:40]), limit=f"1 to {_LONGEST_NAME} characters"
        )
    return name + _SUFFIX


def run_id_of(part: Path) -> str:
    """Return the run id that a part is named after.

    >>> run_id_of(Path("runs.parquet/drive%2F1500%20us.parquet"))
    'drive/1500 us'
    """
    return unquote(part.name.removesuffix(_SUFFIX))


def parts_of(run: Run, header: CampaignHeader) -> dict[str, pa.Table]:
    """Return the run's parts in the order in which they are to be written: the row of ``runs`` makes it exist.

    Raise `CampaignError` if an extra or logged column has the name of a known one.
    """
    return {"poses": _poses_part(run), "commands": _commands_part(run, header), "runs": _runs_part(run)}


def _runs_part(run: Run) -> pa.Table:
    """Return the run's row of the runs table; columns without a value are left out."""
    row: dict[str, object] = {
        "run_id": run.run_id,
        "experiment": run.experiment,
        "trajectory": run.trajectory,
        "condition": run.condition,
        "repeat": int(run.repeat),
        "target_x_m": float(run.target.x_m),
        "target_y_m": float(run.target.y_m),
        "target_heading_rad": float(run.target.heading_rad),
        "started_s": float(run.started_s),
        "status": run.status,
        "firmware": run.firmware,
        "session": run.session,
        "split": run.split,
    }
    if taken := row.keys() & run.extra.keys():
        raise CampaignError(
            "extra column has a known name", where=f"run {run.run_id}", value=min(taken), remedy="rename it"
        )
    row.update(run.extra)
    return pa.table({name: pa.array([value]) for name, value in row.items() if value is not None})


def _commands_part(run: Run, header: CampaignHeader) -> pa.Table:
    """Return the run's rows of the commands table."""
    commands = run.commands
    given = {"t_s": commands.t_s, **file_columns(commands, header)}
    columns = {name: _floats(values) for name, values in given.items()}
    return pa.table({"run_id": pa.repeat(run.run_id, len(commands)), **columns})


def _poses_part(run: Run) -> pa.Table:
    """Return the run's rows of the poses table."""
    frames = run.frames
    columns = {
        "run_id": pa.repeat(run.run_id, len(frames)),
        **{name: _floats(getattr(frames, name)) for name in ("t_s", "x_m", "y_m", "heading_rad")},
        "tracked": pa.array(np.asarray(frames.tracked, np.bool_)),
        "frame": pa.array(np.asarray(frames.frame, np.int64)),
        **{name: _floats(getattr(frames, name)) for name in ("mean_error_m", "received_s")},
    }
    if taken := columns.keys() & run.logged.keys():
        raise CampaignError(
            "logged column has a known name", where=f"run {run.run_id}", value=min(taken), remedy="rename it"
        )
    # A series with other times than the frames has no place in their table.
    same = {name: series.value for name, series in run.logged.items() if np.array_equal(series.t_s, frames.t_s)}
    return pa.table(columns | {name: _floats(value) for name, value in same.items()})


def _floats(values: object) -> pa.Array:
    return pa.array(np.ascontiguousarray(values, np.float64), from_pandas=False)
