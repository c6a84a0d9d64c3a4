"""Runs into a table of errors: one row per run, in the units of the thesis' tables."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from agvbench.errors import FitError
from agvbench.statistics.pose_error import pose_error
from agvbench.statistics.rest import end_pose, start_pose
from agvbench.types import Run

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    *("run_id", "experiment", "trajectory", "condition", "repeat", "session", "firmware", "status", "problem"),
    *("target_x_m", "target_y_m", "target_heading_rad", "end_x_m", "end_y_m", "end_heading_rad"),
    *("position_mm", "along_mm", "across_mm", "heading_deg", "delta_s_mm", "delta_heading_deg", "rotation_deg"),
    *("stderr_position_mm", "stderr_heading_deg"),
)


def pose_errors(runs: Iterable[Run]) -> pd.DataFrame:
    """Return one row per run that has a target: what it is, where it ended, and its errors.

    Columns: those of the runs table; ``problem`` (why the run has no error, else empty); the target and the end
    pose in the start frame [m, rad]; ``position_mm`` (the end position error, not negative); ``along_mm``,
    ``across_mm``, ``heading_deg``, ``delta_s_mm``, ``delta_heading_deg`` (signed; see `PoseError`; the heading error
    and Δδ are one number); ``rotation_deg`` (the rotation made, positive in the target's sense);
    ``stderr_position_mm`` and ``stderr_heading_deg``. Runs that were rejected keep their row: choose them with `valid`.
    """
    import pandas as pd

    rows = [_row(run) for run in runs if run.target.is_finite]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def valid(errors: pd.DataFrame) -> pd.DataFrame:
    """Return the rows whose run counts (status ``ok``) and has an error."""
    return errors[(errors["status"] == "ok") & (errors["problem"] == "")].reset_index(drop=True)


def _row(run: Run) -> dict[str, object]:
    row: dict[str, object] = {
        "run_id": run.run_id,
        "experiment": run.experiment,
        "trajectory": run.trajectory,
        "condition": run.condition,
        "repeat": run.repeat,
        "session": run.session or "",
        "firmware": run.firmware,
        "status": run.status,
        "problem": "",
    }
    row |= dict(zip(("target_x_m", "target_y_m", "target_heading_rad"), run.target, strict=True))
    try:
        return row | _errors(run)
    except FitError as error:
        return row | {"problem": error.what}


def _errors(run: Run) -> dict[str, object]:
    error = pose_error(start_pose(run), end_pose(run), run.target)
    sense = math.copysign(1.0, run.target.heading_rad) if run.target.heading_rad else 1.0
    heading_deg = math.degrees(error.delta_heading_rad)
    return {
        "end_x_m": error.end.x_m,
        "end_y_m": error.end.y_m,
        "end_heading_rad": error.end.heading_rad,
        "position_mm": error.position_m * 1e3,
        "along_mm": error.along_m * 1e3,
        "across_mm": error.across_m * 1e3,
        "heading_deg": heading_deg,
        "delta_s_mm": error.delta_s_m * 1e3,
        "delta_heading_deg": heading_deg,
        "rotation_deg": sense * (math.degrees(run.target.heading_rad) + heading_deg),
        "stderr_position_mm": error.stderr_position_m * 1e3,
        "stderr_heading_deg": math.degrees(error.stderr_heading_rad),
    }
