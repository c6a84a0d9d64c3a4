"""Whether the vehicle can drive the trajectories on this floor."""

from __future__ import annotations

from agvbench.planning import THE_EIGHT, Workspace, user_trajectories
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab
from agvbench.workflows.plan import plan_trajectories


class FloorCheck(Check):
    """Plans what ``agvbench bench`` drives: the eight trajectories and the folder's own, with the bench's vehicle."""

    name = "workspace"

    def examine(self, lab: Lab) -> Finding:
        """Say which cannot be driven, and why the first of them cannot."""
        settings, own = lab.settings, user_trajectories()
        workspace = Workspace.parse(settings.workspace)
        made = plan_trajectories(
            [*THE_EIGHT, *own], vehicle=settings.vehicle, workspace=workspace, steering=settings.steering
        )
        vehicle = settings.vehicle or "the thesis' vehicle"
        where = f"{vehicle} on {workspace.name} with {workspace.margin_m:g} m to spare"
        if not made.problems:
            return Finding(FindingState.GOOD, f"the eight trajectories{_and(own)} can be driven by {where}")
        names = dict.fromkeys(row.trajectory.name for row in made.rows if row.problem)
        said = f"trajectories {' '.join(names)} cannot be driven by {where}: {made.problems[0]}"
        return Finding(FindingState.DOUBTFUL, said, "see agvbench plan, or drive the others")


def _and(own: list[str]) -> str:
    return f" and {' '.join(own)}" if own else ""
