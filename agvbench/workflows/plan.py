"""Show what trajectories mean for a vehicle, without driving."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from agvbench.errors import FlagError, OneOf
from agvbench.model import VehicleModel
from agvbench.planning import (
    DryRun,
    Trajectory,
    Workspace,
    dry_run,
    list_trajectories,
    load_trajectory,
    steered,
)
from agvbench.running.configuration.vehicles import expected_calibration, uncalibrated_vehicle
from agvbench.types import Pose


def models_for(vehicle: str, conditions: Sequence[str]) -> dict[str, VehicleModel]:
    """Return the model of each condition, as a bench with this vehicle file ("" for none) plans before it drives."""
    nominal, expected = uncalibrated_vehicle(vehicle), expected_calibration(vehicle)
    return {condition: nominal if condition == "uncalibrated" else expected for condition in conditions}


def chosen_trajectories(names: Sequence[str], directory: Path | None) -> list[Trajectory]:
    """Return the trajectories of those names or files, all of `directory` if none are named."""
    return [load_trajectory(name, directory=directory) for name in names] or list_trajectories(directory)


def plan_trajectories(
    names: Sequence[str],
    *,
    vehicle: str = "",
    conditions: Sequence[str] = ("uncalibrated", "calibrated"),
    workspace: Workspace | None = None,
    start: Pose | None = None,
    steering: str = "",
    directory: Path | None = None,
    repeats: int = 1,
) -> DryRun:
    """Return the dry run of the named trajectories (all of them if none are named) under `conditions`.

    ``vehicle`` is the file of the vehicle before calibration, "" for the thesis'; where `steering` is "" each
    trajectory is steered as it says, or as the vehicle can.
    """
    models = models_for(vehicle, conditions)
    steers = next(iter(models.values()))
    chosen = [steered(trajectory, steering, steers) for trajectory in chosen_trajectories(names, directory)]
    made = dry_run(
        chosen,
        models,
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
        limit=OneOf(has),
    )
