"""What corrected plans make up for, trajectory by trajectory, before anything is driven."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from agvbench.errors import PlanError
from agvbench.model import VehicleModel
from agvbench.planning import (
    NOTHING_LEFT,
    THE_EIGHT,
    Correction,
    Miss,
    Workspace,
    corrected_plan,
    load_trajectory,
    steered,
)
from agvbench.running.session.end_pose_bias import NO_REMAINDERS
from agvbench.types import Pose

_NOTICEABLE_M, _NOTICEABLE_RAD = 5e-4, math.radians(0.05)


def plans_of(
    model: VehicleModel,
    workspace: str,
    remainders: Mapping[str, Pose] = NO_REMAINDERS,
    names: Sequence[str] = THE_EIGHT,
    steering: str = "",
) -> dict[str, dict[str, Any]]:
    """Return, by trajectory, where the model would end uncorrected and ends corrected, and what to say about it.

    Keys: ``uncorrected``, ``remaining`` and, if the model has effects of the camera, ``beyond_camera``, each with
    ``position_mm``, ``along_mm``, ``across_mm``, ``delta_s_mm``, ``delta_heading_deg``; ``remainder``, what the model
    missed before, in the frame of its end pose; ``said``, sentences; or ``problem`` where it
    cannot be driven.
    """
    floor = Workspace.parse(workspace)
    out: dict[str, dict[str, Any]] = {}
    for name in names:
        trajectory = steered(load_trajectory(name), steering, model)
        if "corrected" not in trajectory.conditions:
            continue
        left = remainders.get(trajectory.name, NOTHING_LEFT)
        try:
            made = corrected_plan(trajectory, model, workspace=floor, remainder=left)
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


def _numbers(miss: Miss) -> dict[str, float]:
    return {
        "position_mm": round(1e3 * miss.distance_m, 3),
        "delta_s_mm": round(1e3 * miss.delta_s_m, 3),
        "delta_heading_deg": round(math.degrees(miss.delta_heading_rad), 4),
        "along_mm": round(1e3 * miss.along_m, 3),
        "across_mm": round(1e3 * miss.across_m, 3),
    }


def _pose(pose: Pose) -> dict[str, float]:
    heading_deg = round(math.degrees(pose.heading_rad), 4)
    return {"along_mm": round(1e3 * pose.x_m, 3), "across_mm": round(1e3 * pose.y_m, 3), "heading_deg": heading_deg}


def _said(correction: Correction) -> list[str]:
    said = []
    if _noticeable(correction.remaining):
        why = f": {' and '.join(correction.at_limits)} at the limit" if correction.at_limits else ""
        said.append(f"cannot be made up for: {_in_words(correction.remaining)} remain{why}")
    if correction.beyond_camera is not None and _noticeable(correction.beyond_camera):
        off = _in_words(correction.beyond_camera)
        said.append(f"on target as the camera sees it; if the camera errs as the model says, truly {off} off")
    return said


def _noticeable(miss: Miss) -> bool:
    return miss.distance_m > _NOTICEABLE_M or abs(miss.delta_heading_rad) > _NOTICEABLE_RAD


def _in_words(miss: Miss) -> str:
    return f"{1e3 * miss.distance_m:.1f} mm and {math.degrees(miss.delta_heading_rad):.2f}°"
