"""Entities of a run in the Rerun viewer: path, plan and target; pose, commands and residual over its time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from agvbench.errors import AgvbenchError, FitError
from agvbench.metrics.measured_run import MeasuredRun, smooth_poses
from agvbench.planning import Workspace
from agvbench.reporting.content import plain, plain_sentences
from agvbench.running.configuration.settings import BenchSettings
from agvbench.statistics.rest_poses import start_pose
from agvbench.types import Commands, Floats, Pose, Run

if TYPE_CHECKING:
    import rerun as rr

TIMELINE, PROGRESS = "run_time", "progress_mm"
FLOOR, FAULTS = "/floor", "/faults"
ARROW_M = 0.25
_RATE_HZ = 60.0
PLANNED = (128, 128, 128)
_ORIGIN = Pose(0.0, 0.0, 0.0)
_COMMANDS, _RESIDUALS = ("drive", "front", "rear"), ("cross-track [mm]", "heading [deg]")


class Place(NamedTuple):
    """The names under which a run is found: trajectory, or experiment without one; condition; run."""

    trajectory: str
    condition: str
    run: str

    @classmethod
    def of(cls, run: Run) -> Place:
        """Return the place of a recorded run."""
        return cls(*map(plain, (run.trajectory or run.experiment, run.condition, run.run_id)))

    @property
    def entity(self) -> str:
        """The path of its entities."""
        import rerun as rr

        return str(rr.new_entity_path(["runs", *self]))


def session_workspace(directory: Path) -> Workspace | None:
    """Return the workspace of the session that recorded a campaign; None where the campaign does not have it."""
    try:
        return Workspace.parse(BenchSettings.load(directory).workspace)
    except AgvbenchError:
        return None


def send_floor(recording: rr.RecordingStream, workspace: Workspace | None) -> None:
    """Send the axes and, where it is known, the edge of the workspace."""
    import rerun as rr

    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if workspace is not None:
        corners = _corners(workspace)
        edge = line(np.vstack([corners, corners[:1]]), PLANNED, 0.004)
        recording.log(f"{FLOOR}/workspace", edge, static=True)


def _corners(workspace: Workspace) -> Floats:
    """Return where successive edges of a workspace meet, shape (k, 2)."""
    pairs = np.stack([workspace.normals, np.roll(workspace.normals, -1, axis=0)], axis=1)
    offsets = np.stack([workspace.offsets, np.roll(workspace.offsets, -1)], axis=1)
    return np.asarray(np.linalg.solve(pairs, offsets[:, :, None])[:, :, 0])


def send_run(recording: rr.RecordingStream, run: MeasuredRun, shown: str) -> None:
    """Send a run as columns of the whole run, in the colour `shown`.

    Row by row, as the vehicle drives, a pose takes the viewer and this process 200 times as long.
    """
    entity = Place.of(run).entity
    poses = _thinned(smooth_poses(run.frames))
    if len(poses) >= 2:
        _send_motion(recording, entity, poses, run, shown)
    _send_plan(recording, entity, *_on_floor(run))
    if run.planned is not None:
        _send_residual(recording, entity, run, run.planned)


def _send_motion(recording: rr.RecordingStream, entity: str, poses: Floats, run: Run, shown: str) -> None:
    """Send the driven path, the vehicle on it, and the commands as steps."""
    import rerun as rr

    rgb = [int(shown[i : i + 2], 16) for i in (1, 3, 5)]
    flat = np.column_stack([poses[:, 1:3], np.zeros(len(poses))])
    recording.log(f"{entity}/path", line(poses[:, 1:3], rgb, 0.004), static=True)
    recording.log(f"{entity}/vehicle", arrow(_ORIGIN, rgb, 0.012), static=True)
    turn = np.column_stack([np.zeros((len(poses), 2)), np.sin(poses[:, 3] / 2), np.cos(poses[:, 3] / 2)])
    moved = rr.Transform3D.columns(translation=flat, quaternion=turn)
    recording.send_columns(f"{entity}/vehicle", indexes=[_time(poses[:, 0])], columns=moved)
    if len(run.commands):
        at, held = _steps(run.commands, float(poses[-1, 0]))
        recording.log(f"{entity}/commands", rr.SeriesLines(names=list(_COMMANDS)), static=True)
        columns = rr.Scalars.columns(scalars=held)
        recording.send_columns(f"{entity}/commands", indexes=[_time(at)], columns=columns)


def _on_floor(run: MeasuredRun) -> tuple[Floats | None, Pose | None]:
    """Return the planned path (n, 2) [m] and the target in the floor frame, from the measured start; None without."""
    try:
        start = start_pose(run).pose
    except FitError:
        return None, None
    target = start.compose(run.target) if run.target.is_finite else None
    return None if run.planned is None else start.place(run.planned[:, 1:3]), target


def _send_plan(recording: rr.RecordingStream, entity: str, path: Floats | None, target: Pose | None) -> None:
    if path is not None:
        recording.log(f"{entity}/plan", line(path, PLANNED, 0.002), static=True)
    if target is not None:
        recording.log(f"{entity}/target", arrow(target, PLANNED, 0.008), static=True)


def line(points: Floats, rgb: Sequence[int], radius_m: float) -> rr.LineStrips3D:
    """Return a line on the floor through `points`, shape (n, 2) [m]."""
    import rerun as rr

    return rr.LineStrips3D([np.column_stack([points, np.zeros(len(points))])], colors=[rgb], radii=[radius_m])


def arrow(pose: Pose, rgb: Sequence[int], radius_m: float) -> rr.Arrows3D:
    """Return an arrow on the floor from a pose in the direction of its heading."""
    import rerun as rr

    ahead = [ARROW_M * math.cos(pose.heading_rad), ARROW_M * math.sin(pose.heading_rad), 0.0]
    return rr.Arrows3D(vectors=[ahead], origins=[[*pose[:2], 0.0]], colors=[rgb], radii=[radius_m])


def _send_residual(recording: rr.RecordingStream, entity: str, run: MeasuredRun, path: Floats) -> None:
    """Send the residual along the path: over its length, and over the time at which the plan is there."""
    import rerun as rr

    try:
        errors = run.tracking
    except FitError:
        return
    if errors is None:
        return
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, 1:3], axis=0).T))])
    at_s = np.interp(errors.progress_m, way_m, path[:, 0])
    progress = rr.TimeColumn(PROGRESS, sequence=np.rint(1e3 * errors.progress_m).astype(np.int64))
    residual = np.column_stack([1e3 * errors.cross_track_m, np.degrees(errors.heading_rad)])
    recording.log(f"{entity}/residual", rr.SeriesLines(names=list(_RESIDUALS)), static=True)
    columns = rr.Scalars.columns(scalars=residual)
    recording.send_columns(f"{entity}/residual", indexes=[_time(at_s), progress], columns=columns)


def send_fault(recording: rr.RecordingStream, time_s: float, level: str, line: str) -> None:
    """Send a line about the time `time_s` of the campaign [s]; `level` as in the table of events."""
    import rerun as rr

    recording.set_time("campaign_time", duration=time_s)
    recording.log(FAULTS, rr.TextLog(plain_sentences(line), level=level.upper()))


def send_events(recording: rr.RecordingStream, rows: Iterable[Mapping[Any, Any]]) -> None:
    """Send rows of the campaign's table of events as faults."""
    for row in rows:
        line = f"{row['run_id']} {row['source']} {row['event']}: {row['text']}"
        send_fault(recording, float(row["time_s"]), str(row["level"]), line)


def _steps(commands: Commands, until_s: float) -> tuple[Floats, Floats]:
    """Return times and commands with the corners of steps: each command again when the next one replaces it."""
    levels = np.column_stack([commands.drive, commands.front, commands.rear])
    end = max(until_s, float(commands.t_s[-1]))
    return np.append(np.repeat(commands.t_s, 2)[1:], end), np.repeat(levels, 2, axis=0)


def _time(t_s: Floats) -> rr.TimeColumn:
    import rerun as rr

    return rr.TimeColumn(TIMELINE, duration=t_s)


def _thinned(poses: Floats) -> Floats:
    """Return at most one pose per 1/60 s: the first of each."""
    slots = np.floor(poses[:, 0] * _RATE_HZ)
    return np.asarray(poses[np.unique(slots, return_index=True)[1]])
