"""A recording for the Rerun viewer: every run's path, plan and target, its pose and commands over its time."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.campaign import CampaignHeader
from agvbench.errors import AgvbenchError, FitError
from agvbench.model import VehicleModel, thesis_vehicle
from agvbench.planning import Plan, load_trajectory, plan, steered
from agvbench.planning.trajectories.trajectory import TRAJECTORY_NAME
from agvbench.plot.driven_paths import smooth_poses
from agvbench.plot.style import colour, condition_numbers
from agvbench.reporting.content import plain
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.rest_poses import start_pose
from agvbench.types import Commands, Floats, Pose, Run
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import rerun as rr

_SAME_TARGET = 1e-6


class PlannedPaths:
    """Plans the runs of a campaign again, with its vehicle: a path is geometry, the same under each condition.

    Parameters
    ----------
    path, header
        The campaign; without a ``vehicle.toml`` in it, the thesis' vehicle with the campaign's axles.
    """

    def __init__(self, path: Path, header: CampaignHeader) -> None:
        self._model = _vehicle(path, header)
        self._plan = lru_cache(maxsize=None)(self._planned)

    def of(self, run: Run) -> tuple[Floats | None, Pose | None]:
        """Return the path in the floor frame, shape (n, 2) [m], and the target pose there.

        None for a path whose trajectory is not known here, or leads to another target than the run had; None for the
        target of a run that has none. The start is the measured one.
        """
        try:
            start = start_pose(run).pose
        except FitError:
            return None, None
        target = start.compose(run.target) if run.target.is_finite else None
        made = self._plan(run.trajectory.removesuffix(f"-{run.extra.get('controller', '')}"))
        if made is None or not np.allclose(made.target, run.target, rtol=0.0, atol=_SAME_TARGET, equal_nan=True):
            return None, target
        c, s = np.cos(start.heading_rad), np.sin(start.heading_rad)
        return made.expected[:, 1:3] @ np.array([[c, s], [-s, c]]) + np.array(start[:2]), target

    def _planned(self, name: str) -> Plan | None:
        if not TRAJECTORY_NAME.fullmatch(name) or name.endswith(".toml"):
            return None
        try:
            return plan(steered(load_trajectory(name), "", self._model), self._model)
        except AgvbenchError:
            return None


def _vehicle(path: Path, header: CampaignHeader) -> VehicleModel:
    try:
        return VehicleModel.load(path / "vehicle.toml")
    except AgvbenchError:
        return replace(thesis_vehicle(), geometry=header.geometry)


TIMELINE = "run_time"
_ARROW_M = 0.25
_RATE_HZ = 60.0
_PLANNED = (128, 128, 128)


def write_recording(data: ReportData, path: Path) -> None:
    """Write `data` as a recording: columns of whole runs, never row by row.

    Under ``/runs/TRAJECTORY/CONDITION/RUN``: ``path``, ``plan`` (lines) and ``target`` (an arrow), always there;
    ``vehicle`` (an arrow that moves on the timeline ``run_time``, 0 at the first command) and ``commands`` (each of the
    three, held until the next). Poses are thinned to 60 Hz. The viewer opens with all runs on one floor, and with a tab
    for each trajectory, in it for each condition, in it for each run: its floor over its commands.
    """
    import rerun as rr

    counted = [run for run in data.runs if run.is_ok]
    plans = PlannedPaths(data.path, data.header)
    recording = rr.RecordingStream("agvbench", recording_id=plain(data.header.name), send_properties=False)
    recording.save(path, default_blueprint=_blueprint(counted))
    numbers = condition_numbers(in_order(run.condition for run in data.runs))
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for run in counted:
        _send_run(recording, run, colour(numbers[run.condition]))
        _send_plan(recording, _entity(run), *plans.of(run))
    recording.flush()
    recording.disconnect()


def _send_run(recording: rr.RecordingStream, run: Run, shown: str) -> None:
    import rerun as rr

    poses = _thinned(smooth_poses(run.frames))
    if len(poses) < 2:
        return
    entity = _entity(run)
    rgb = [int(shown[i : i + 2], 16) for i in (1, 3, 5)]
    flat = np.column_stack([poses[:, 1:3], np.zeros(len(poses))])
    recording.log(f"{entity}/path", rr.LineStrips3D([flat], colors=[rgb], radii=[0.004]), static=True)
    arrow = rr.Arrows3D(vectors=[[_ARROW_M, 0.0, 0.0]], colors=[rgb], radii=[0.012])
    recording.log(f"{entity}/vehicle", arrow, static=True)
    turn = np.column_stack([np.zeros((len(poses), 2)), np.sin(poses[:, 3] / 2), np.cos(poses[:, 3] / 2)])
    moved = rr.Transform3D.columns(translation=flat, quaternion=turn)
    recording.send_columns(f"{entity}/vehicle", indexes=[_time(poses[:, 0])], columns=moved)
    if len(run.commands):
        at, held = _steps(run.commands, float(poses[-1, 0]))
        recording.log(f"{entity}/commands", rr.SeriesLines(names=["drive", "front", "rear"]), static=True)
        columns = rr.Scalars.columns(scalars=held)
        recording.send_columns(f"{entity}/commands", indexes=[_time(at)], columns=columns)


def _send_plan(recording: rr.RecordingStream, entity: str, path: Floats | None, target: Pose | None) -> None:
    import rerun as rr

    if path is not None:
        line = rr.LineStrips3D([np.column_stack([path, np.zeros(len(path))])], colors=[_PLANNED], radii=[0.002])
        recording.log(f"{entity}/plan", line, static=True)
    if target is not None:
        ahead = [_ARROW_M * math.cos(target.heading_rad), _ARROW_M * math.sin(target.heading_rad), 0.0]
        arrow = rr.Arrows3D(vectors=[ahead], origins=[[*target[:2], 0.0]], colors=[_PLANNED], radii=[0.008])
        recording.log(f"{entity}/target", arrow, static=True)


def _steps(commands: Commands, until_s: float) -> tuple[Floats, Floats]:
    """Return times and commands with the corners of steps: each command again when the next one replaces it."""
    levels = np.column_stack([commands.drive, commands.front, commands.rear])
    end = max(until_s, float(commands.t_s[-1]))
    return np.append(np.repeat(commands.t_s, 2)[1:], end), np.repeat(levels, 2, axis=0)


def _place(run: Run) -> tuple[str, str, str]:
    """Return the names under which a run is found: trajectory, condition, run."""
    trajectory, condition, name = map(plain, (run.trajectory or run.experiment, run.condition, run.run_id))
    return trajectory, condition, name


def _entity(run: Run) -> str:
    import rerun as rr

    return str(rr.new_entity_path(["runs", *_place(run)]))


def _time(t_s: Floats) -> rr.TimeColumn:
    import rerun as rr

    return rr.TimeColumn(TIMELINE, duration=t_s)


def _thinned(poses: Floats) -> Floats:
    """Return at most one pose per 1/60 s: the first of each."""
    slots = np.floor(poses[:, 0] * _RATE_HZ)
    return np.asarray(poses[np.unique(slots, return_index=True)[1]])


def _blueprint(runs: list[Run]) -> Any:
    import rerun.blueprint as rrb

    floor = rrb.Spatial3DView(origin="/", contents=["/runs/**"], name="All runs")
    tabs: dict[str, dict[str, list[Any]]] = {}
    for run in runs:
        trajectory, condition, name = _place(run)
        tabs.setdefault(trajectory, {}).setdefault(condition, []).append(_one_run(_entity(run), name))
    inside = [
        rrb.Tabs(*(rrb.Tabs(*views, name=condition) for condition, views in conditions.items()), name=trajectory)
        for trajectory, conditions in tabs.items()
    ]
    return rrb.Blueprint(rrb.Tabs(floor, *inside), collapse_panels=True)


def _one_run(entity: str, name: str) -> Any:
    import rerun.blueprint as rrb

    return rrb.Vertical(
        rrb.Spatial3DView(origin="/", contents=[f"{entity}/**"], name="Floor"),
        rrb.TimeSeriesView(origin=entity, contents=[f"{entity}/commands"], name="Commands"),
        row_shares=[3, 1],
        name=name,
    )
