"""Plans for a vehicle with effects: commands that compensate them, and the error that remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from agvbench.effects import Stage
from agvbench.model import VehicleModel
from agvbench.planning.end_pose_prediction import Departure, EndPoseError, coasting_path, rest_poses
from agvbench.planning.leg import Leg, axles_swept, stops
from agvbench.planning.legs import legs_of
from agvbench.planning.placement import check_fits
from agvbench.planning.planner import Plan, commands_of, plan
from agvbench.planning.shooting import Range, shoot
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.planning.workspace import Workspace
from agvbench.types import Commands, Floats, Pose

NO_BIAS = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Correction:
    """What a corrected plan compensates, by the model that it was made with.

    Parameters
    ----------
    uncorrected
        Where the plan of the static maps alone would end.
    remaining
        Where the corrected plan ends. Both include what the model is known to miss, if that was given.
    beyond_camera
        Where it ends if the camera's own effects are left out: a camera that measures a wrong scale, or markers that
        sit elsewhere than the vehicle file says, make the vehicle miss where they see it hit. None where the model
        has no such effect.
    at_limits
        What could not be changed further, if anything remains.
    """

    uncorrected: EndPoseError
    remaining: EndPoseError
    beyond_camera: EndPoseError | None = None
    at_limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class CorrectedPlan(Plan):
    """A `Plan` whose ``expected`` path has the model's effects and ends at rest; ``correction`` says what they cost.

    It is None where there is nothing to correct: commands of the trajectory's own, or no target.
    """

    correction: Correction | None = None


def corrected_plan(
    trajectory: Trajectory,
    model: VehicleModel,
    *,
    workspace: Workspace | None = None,
    departure: Departure | None = None,
    start: Pose | None = None,
    end_pose_bias: Pose = NO_BIAS,
) -> CorrectedPlan:
    """Return timed commands with which `model`, effects and all, comes to rest on the target.

    The plan of the static maps alone comes first; then steering and durations are changed as little as brings the
    model's rest pose, as the camera sees it, onto the target (see `agvbench.planning.shooting`).

    Parameters
    ----------
    trajectory, workspace, start
        As for `plan`.
    model
        What is known of the vehicle.
    departure
        When and where the run begins; its start pose gives way to `start` or, with a workspace, to the one that is
        chosen there.
    end_pose_bias
        What the model is known to miss on this trajectory: the measured end pose in the frame of the predicted one. The
        aim is moved, so that with it the vehicle ends on the target.

    Raises
    ------
    PlanError
        If the vehicle cannot drive the trajectory, or not inside the workspace.
    """
    made = plan(trajectory, model, workspace=workspace, start=start)
    departure = departure or Departure()
    if workspace is not None or start is not None:
        departure = replace(departure, start=made.start)
    if trajectory.commands is not None or not made.target.is_finite:
        return _plain(made)
    legs = legs_of(trajectory, model)

    def ends(several: Sequence[Sequence[Leg]]) -> Floats:
        return rest_poses(model, [commands_of(each, model) for each in several], departure)

    aim = made.target.compose(NO_BIAS.relative_to(end_pose_bias))
    shot = shoot(legs, _reach(model, "front"), _reach(model, "rear"), aim, ends)
    commands = commands_of(shot.legs, model)
    path = coasting_path(model, commands, departure)
    swept = axles_swept(path, model.geometry)
    needed = np.concatenate([swept, stops(path)])
    if workspace is not None:
        check_fits(needed, departure.start, workspace, where=trajectory.name)
    before, after = (
        EndPoseError(Pose(*end).compose(end_pose_bias), made.target) for end in ends([legs, shot.legs]).tolist()
    )
    physical_end = _beyond_camera(model, commands, departure)
    beyond = None if physical_end is None else EndPoseError(physical_end.compose(end_pose_bias), made.target)
    correction = Correction(before, after, beyond, shot.at_limits)
    width, height = np.ptp(swept[:, 1:], axis=0).tolist()
    return replace(
        _plain(made),
        commands=commands,
        duration_s=float(commands.t_s[-1]),
        expected=path,
        floor_m=(width, height),
        start=departure.start,
        swept=needed,
        correction=correction,
    )


def depends_on_time(made: CorrectedPlan, model: VehicleModel, departure: Departure) -> bool:
    """Return whether the vehicle would rest elsewhere, by the model, if the run began an hour later."""
    later = replace(departure, started_h=departure.started_h + 1.0)
    now, then = (rest_poses(model, [made.commands], when) for when in (departure, later))
    return bool(np.abs(then - now).max() > 1e-5)


def _plain(made: Plan) -> CorrectedPlan:
    return CorrectedPlan(**vars(made))


def _reach(model: VehicleModel, axle: Literal["front", "rear"]) -> Range:
    """Return the smallest and the largest output of an axle's map to which its channel can be commanded."""
    static_map, channel = getattr(model, axle), getattr(model.channels, axle)
    low, high = static_map.output_range
    if low == high:
        return low, high
    lowest, highest = sorted(float(static_map(end)) for end in (channel.low, channel.high))
    return max(low, lowest), min(high, highest)


def _beyond_camera(model: VehicleModel, commands: Commands, departure: Departure) -> Pose | None:
    kept = tuple(effect for effect in model.effects if effect.stage is not Stage.CAMERA)
    if len(kept) == len(model.effects):
        return None
    end = rest_poses(replace(model, effects=kept), [commands], departure)[0]
    return Pose(*end.tolist())
