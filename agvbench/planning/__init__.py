"""From a declared trajectory to timed commands.

::

    TOML ─► Trajectory ─► segments ─► legs ─► commands, expected path, target, floor
            (schema)      (shapes)    (this vehicle's axle angles, speed and time)

`load_trajectory` reads, `plan` does the rest and raises `PlanError` before anything moves.
"""

from agvbench.planning.planner import Plan, place, plan
from agvbench.planning.reading import list_trajectories, load_trajectory, trajectory_from_table
from agvbench.planning.summary import DryRun, DryRunRow, dry_run
from agvbench.planning.trajectory import Trajectory
from agvbench.planning.workspace import Workspace

__all__ = [
    "DryRun",
    "DryRunRow",
    "Plan",
    "Trajectory",
    "Workspace",
    "dry_run",
    "list_trajectories",
    "load_trajectory",
    "place",
    "plan",
    "trajectory_from_table",
]
