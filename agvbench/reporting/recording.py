"""A recording for the Rerun viewer: every run's path, and its pose and commands over its own time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.reporting.conditions import condition_numbers
from agvbench.reporting.content import plain
from agvbench.reporting.figures.paths import smooth_poses
from agvbench.reporting.figures.style import colour
from agvbench.statistics.end_poses import in_order
from agvbench.types import Floats, Run
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import rerun as rr

TIMELINE = "run_time"
_ARROW_M = 0.25
_RATE_HZ = 60.0


def write_recording(data: ReportData, path: Path) -> None:
    """Write `data` as a recording: columns of whole runs, never row by row.

    Under ``/runs/TRAJECTORY/CONDITION/RUN``: ``path`` (a line, always there), ``vehicle`` (an arrow that moves on the
    timeline ``run_time``, 0 at the first command) and ``commands`` (the three commands). Poses are thinned to 60 Hz.
    """
    import pandas as pd
    import rerun as rr

    recording = rr.RecordingStream("agvbench", recording_id=plain(data.header.name), send_properties=False)
    recording.save(path, default_blueprint=_blueprint())
    numbers = condition_numbers(in_order(pd.Series([run.condition for run in data.runs], dtype=str)))
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for run in data.runs:
        if run.is_ok:
            _send_run(recording, run, colour(numbers[run.condition]))
    recording.flush()
    recording.disconnect()


def _send_run(recording: rr.RecordingStream, run: Run, shown: str) -> None:
    import rerun as rr

    poses = _thinned(smooth_poses(run.frames))
    if len(poses) < 2:
        return
    entity = rr.new_entity_path(["runs", *map(plain, (run.trajectory or run.experiment, run.condition, run.run_id))])
    rgb = [int(shown[i : i + 2], 16) for i in (1, 3, 5)]
    flat = np.column_stack([poses[:, 1:3], np.zeros(len(poses))])
    recording.log(f"{entity}/path", rr.LineStrips3D([flat], colors=[rgb], radii=[0.004]), static=True)
    arrow = rr.Arrows3D(vectors=[[_ARROW_M, 0.0, 0.0]], colors=[rgb], radii=[0.012])
    recording.log(f"{entity}/vehicle", arrow, static=True)
    turn = np.column_stack([np.zeros((len(poses), 2)), np.sin(poses[:, 3] / 2), np.cos(poses[:, 3] / 2)])
    moved = rr.Transform3D.columns(translation=flat, quaternion=turn)
    recording.send_columns(f"{entity}/vehicle", indexes=[_time(poses[:, 0])], columns=moved)
    if len(run.commands):
        told = np.column_stack([run.commands.drive, run.commands.front, run.commands.rear])
        names = rr.SeriesLines(names=["drive", "front", "rear"])
        recording.log(f"{entity}/commands", names, static=True)
        index = [_time(run.commands.t_s)]
        recording.send_columns(f"{entity}/commands", indexes=index, columns=rr.Scalars.columns(scalars=told))


def _time(t_s: Floats) -> rr.TimeColumn:
    import rerun as rr

    return rr.TimeColumn(TIMELINE, duration=t_s)


def _thinned(poses: Floats) -> Floats:
    """Return at most one pose per 1/60 s: the first of each."""
    slots = np.floor(poses[:, 0] * _RATE_HZ)
    return np.asarray(poses[np.unique(slots, return_index=True)[1]])


def _blueprint() -> Any:
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Spatial3DView(origin="/", contents=["/runs/**"], name="Floor"),
            rrb.TimeSeriesView(origin="/runs", contents=["/runs/**"], name="Commands"),
            row_shares=[4, 1],
        ),
        collapse_panels=True,
    )
