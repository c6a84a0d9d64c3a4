"""From a declared trajectory to timed commands.

::

    TOML ─► Trajectory ─► segments ─► legs ─► commands, expected path, target, floor
            (schema)      (shapes)    (this vehicle's axle angles, speed and time)

`load_trajectory` reads, `plan` does the rest and raises `PlanError` before anything moves. For a model with effects,
`corrected_plan` changes steering and durations until the model comes to rest on the target.
"""

from agvbench.planning.correction import NO_BIAS, CorrectedPlan, Correction, corrected_plan, depends_on_time
from agvbench.planning.dry_runs import DryRun, DryRunRow, dry_run
from agvbench.planning.end_pose_prediction import Departure, EndPoseError
from agvbench.planning.planner import Plan, place, plan
from agvbench.planning.trajectories.loading import (
    THE_EIGHT,
    driven_trajectories,
    list_trajectories,
    load_trajectory,
    trajectory_from_table,
    user_trajectories,
)
from agvbench.planning.trajectories.trajectory import Trajectory, steered
from agvbench.planning.workspace import Workspace

__all__ = [
    "NO_BIAS",
    "THE_EIGHT",
    "CorrectedPlan",
    "Correction",
    "Departure",
    "DryRun",
    "DryRunRow",
    "EndPoseError",
    "Plan",
    "Trajectory",
    "Workspace",
    "corrected_plan",
    "depends_on_time",
    "driven_trajectories",
    "dry_run",
    "list_trajectories",
    "load_trajectory",
    "place",
    "plan",
    "steered",
    "trajectory_from_table",
    "user_trajectories",
]
