"""Show what trajectories mean for a vehicle, without driving."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from agvbench.errors import FlagError
from agvbench.model import VehicleModel, nominal_model, thesis_vehicle
from agvbench.planning import (
    DryRun,
    Trajectory,
    Workspace,
    dry_run,
    list_trajectories,
    load_trajectory,
    steered,
)
from agvbench.types import Pose
from agvbench.vehicle.maps import Fixed


def models_for(vehicle: Path | None, conditions: Sequence[str]) -> dict[str, VehicleModel]:
    """Return the model of each condition: nominal maps when uncalibrated, the vehicle file's otherwise."""
    model = VehicleModel.load(vehicle) if vehicle else thesis_vehicle()
    nominal = nominal_model(
        model.name,
        model.geometry,
        model.command_unit,
        model.neutral,
        rear_steered=not isinstance(model.rear, Fixed),
    )
    return {condition: nominal if condition == "uncalibrated" else model for condition in conditions}


def chosen_trajectories(names: Sequence[str], directory: Path | None, steering: str | None) -> list[Trajectory]:
    """Return the trajectories of those names or files (all of `directory` if none are named), steered as asked."""
    found = [load_trajectory(name, directory=directory) for name in names] or list_trajectories(directory)
    return [steered(trajectory, steering or "") for trajectory in found]


def plan_trajectories(
    names: Sequence[str],
    *,
    vehicle: Path | None = None,
    conditions: Sequence[str] = ("uncalibrated", "calibrated"),
    workspace: Workspace | None = None,
    start: Pose | None = None,
    steering: str | None = None,
    directory: Path | None = None,
    repeats: int = 1,
) -> DryRun:
    """Return the dry run of the named trajectories (all of them if none are named) under `conditions`."""
    chosen = chosen_trajectories(names, directory, steering)
    made = dry_run(
        chosen,
        models_for(vehicle, conditions),
        repeats=repeats,
        workspace=workspace,
        start=start,
    )
    if not made.rows:
        raise _no_condition(chosen, conditions)
    return made


def _no_condition(trajectories: Sequence[Trajectory], conditions: Sequence[str]) -> FlagError:
    has = dict.fromkeys(condition for trajectory in trajectories for condition in trajectory.conditions)
    return FlagError(
        f"trajectory {', '.join(t.name for t in trajectories)} is not driven under this condition",
        where="--condition",
        value=", ".join(conditions),
        limit=", ".join(has),
    )
