"""Whether the floor is large enough for the eight trajectories."""

from __future__ import annotations

from agvbench.errors import PlanError
from agvbench.model import VehicleModel, thesis_vehicle
from agvbench.planning import Workspace, load_trajectory, plan
from agvbench.workflows.doctor.finding import Check, Finding, Lab, State

_EIGHT = tuple(map(str, range(1, 9)))


class Floor(Check):
    """Plans the eight trajectories for the thesis' vehicle inside the workspace."""

    name = "workspace"

    def examine(self, lab: Lab) -> Finding:
        """Say which do not fit."""
        workspace = Workspace.parse(lab.workspace)
        vehicle = thesis_vehicle()
        outside = [name for name in _EIGHT if not _fits(name, workspace, vehicle)]
        if outside:
            said = (
                f"trajectories {' '.join(outside)} do not fit {workspace.name} with {workspace.margin_m:g} m to spare"
            )
            return Finding(State.DOUBTFUL, said, "clear more floor, or drive the others")
        return Finding(
            State.GOOD, f"the eight trajectories fit {workspace.name} with {workspace.margin_m:g} m to spare"
        )


def _fits(name: str, workspace: Workspace, vehicle: VehicleModel) -> bool:
    try:
        plan(load_trajectory(name), vehicle, workspace=workspace)
    except PlanError:
        return False
    return True
