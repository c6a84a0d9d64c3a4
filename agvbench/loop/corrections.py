"""Corrections of trajectories: end-pose bias of earlier sessions, and what corrected plans compensate.

An effect that is not in the library, or has another form than the library's, leaves a bias on each trajectory that was
measured. Its significant part is subtracted from the goal of the corrected plan. This correction explains nothing: it
holds for this trajectory, driven from this place, and says nothing about any other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from agvbench.campaign import Campaign
from agvbench.campaign.campaign import session_starts
from agvbench.errors import FitError, PlanError
from agvbench.model import VehicleModel
from agvbench.planning import (
    NO_BIAS,
    THE_EIGHT,
    Correction,
    Departure,
    EndPoseError,
    Workspace,
    corrected_plan,
    load_trajectory,
    steered,
)
from agvbench.planning.end_pose_prediction import rest_poses
from agvbench.running.session.end_pose_bias import NO_BIAS_CORRECTIONS
from agvbench.statistics.rest_poses import end_pose, start_pose
from agvbench.types import Floats, Pose, Run

FEWEST = 3
"""Fewer runs than this do not distinguish a bias from random error."""


def bias_corrections(campaign: Campaign, model: VehicleModel, condition: str) -> dict[str, dict[str, float]]:
    """Return the bias of `model` by trajectory: the mean measured end pose in the frame of the predicted one.

    Learned from the runs of one condition: those with commands nearest to what will be driven. Each component is shrunk
    by the share of its square that its standard error explains, so that random errors are not learned.
    """
    runs = [run for run in campaign.select(condition=condition) if run.target.is_finite]
    began, out = session_starts(campaign), {}
    for name in dict.fromkeys(run.trajectory for run in runs):
        driven = ((run, run.started_s - began[run.session]) for run in runs if run.trajectory == name)
        residuals = np.array(list(_end_pose_residuals(driven, model))).reshape(-1, 3)
        if len(residuals) >= FEWEST:
            x, y, heading = shrunken_mean(residuals).tolist()
            out[name] = {
                "x_m": round(x, 6),
                "y_m": round(y, 6),
                "heading_rad": round(heading, 6),
                "runs": len(residuals),
            }
    return out


def shrunken_mean(values: Floats) -> Floats:
    """Return the mean of `values` (n, k), shape (k,), each shrunk towards zero by its random error.

    >>> shrunken_mean(np.array([[3.0, 1.0], [3.0, -1.0], [3.0, 0.5]])).tolist()
    [3.0, 0.0]
    """
    mean, stderr = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
    share = np.divide(stderr, mean, out=np.full_like(mean, np.inf), where=mean != 0.0)
    return np.asarray(mean * np.maximum(0.0, 1.0 - share**2))


def _end_pose_residuals(runs: Iterable[tuple[Run, float]], model: VehicleModel) -> Iterable[Pose]:
    for run, since_s in runs:
        try:
            start, end = start_pose(run).pose, end_pose(run).pose
        except FitError:
            continue  # a run without a pose at rest is no evidence
        departure = Departure(start, since_s / 3600.0)
        predicted = rest_poses(model, [run.commands], departure)[0]
        yield end.relative_to(start).relative_to(Pose(*predicted.tolist()))


_NOTICEABLE_M, _NOTICEABLE_RAD = 5e-4, math.radians(0.05)


def plans_of(
    model: VehicleModel,
    workspace: str,
    bias_corrections: Mapping[str, Pose] = NO_BIAS_CORRECTIONS,
    names: Sequence[str] = THE_EIGHT,
    steering: str = "",
) -> dict[str, dict[str, Any]]:
    """Return, by trajectory, where the model would end uncorrected and ends corrected, and what to say about it.

    Keys: ``uncorrected``, ``remaining`` and, if the model has effects of the camera, ``beyond_camera``, each with
    ``position_mm``, ``along_mm``, ``across_mm``, ``delta_s_mm``, ``delta_heading_deg``; ``remainder``, the bias of the
    model so far, in the frame of its end pose; ``said``, sentences; or ``problem`` where it cannot be driven.
    """
    floor = Workspace.parse(workspace)
    out: dict[str, dict[str, Any]] = {}
    for name in names:
        trajectory = steered(load_trajectory(name), steering, model)
        if "corrected" not in trajectory.conditions:
            continue
        left = bias_corrections.get(trajectory.name, NO_BIAS)
        try:
            made = corrected_plan(trajectory, model, workspace=floor, end_pose_bias=left)
        except PlanError as error:
            out[trajectory.name] = {"problem": str(error)}
            continue
        if made.correction is not None:
            out[trajectory.name] = _entry(made.correction) | {"remainder": _pose(left)}
    return out


def _entry(correction: Correction) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "uncorrected": _numbers(correction.uncorrected),
        "remaining": _numbers(correction.remaining),
        "said": _said(correction),
    }
    if correction.beyond_camera is not None:
        entry["beyond_camera"] = _numbers(correction.beyond_camera)
    return entry


def _numbers(end_error: EndPoseError) -> dict[str, float]:
    return {
        "position_mm": round(1e3 * end_error.distance_m, 3),
        "delta_s_mm": round(1e3 * end_error.delta_s_m, 3),
        "delta_heading_deg": round(math.degrees(end_error.delta_heading_rad), 4),
        "along_mm": round(1e3 * end_error.along_m, 3),
        "across_mm": round(1e3 * end_error.across_m, 3),
    }


def _pose(pose: Pose) -> dict[str, float]:
    heading_deg = round(math.degrees(pose.heading_rad), 4)
    return {"along_mm": round(1e3 * pose.x_m, 3), "across_mm": round(1e3 * pose.y_m, 3), "heading_deg": heading_deg}


def _said(correction: Correction) -> list[str]:
    said = []
    if _noticeable(correction.remaining):
        why = f": {' and '.join(correction.at_limits)} at the limit" if correction.at_limits else ""
        said.append(f"cannot be compensated: {_in_words(correction.remaining)} remain{why}")
    if correction.beyond_camera is not None and _noticeable(correction.beyond_camera):
        off = _in_words(correction.beyond_camera)
        said.append(f"on target as the camera sees it; if the camera errs as the model says, truly {off} off")
    return said


def _noticeable(end_error: EndPoseError) -> bool:
    return end_error.distance_m > _NOTICEABLE_M or abs(end_error.delta_heading_rad) > _NOTICEABLE_RAD


def _in_words(end_error: EndPoseError) -> str:
    return f"{1e3 * end_error.distance_m:.1f} mm and {math.degrees(end_error.delta_heading_rad):.2f}°"
