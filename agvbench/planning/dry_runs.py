"""Dry runs: how long a campaign takes, how much floor it needs, and what cannot be driven."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.correction import corrected_plan
from agvbench.planning.planner import Plan, plan
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.planning.workspace import DEFAULT_MARGIN_M, Workspace
from agvbench.types import Pose

BETWEEN_RUNS_S = 17.0
"""Time at rest before and after a run (2 s), and to bring the vehicle back to its start [s]."""


@dataclass(frozen=True)
class DryRunRow:
    """One trajectory under one condition; `plan` is None where it cannot be driven, and `problem` says why."""

    trajectory: Trajectory
    condition: str
    plan: Plan | None
    problem: PlanError | None


@dataclass(frozen=True)
class DryRun:
    """What would be driven, `repeats` times each, with `between_runs_s` between two runs.

    ``margin_m`` is what the vehicle needs around its axles' centres [m].
    """

    rows: tuple[DryRunRow, ...]
    repeats: int
    between_runs_s: float
    margin_m: float = DEFAULT_MARGIN_M

    def floor_of(self, plan: Plan) -> tuple[float, float]:
        """Return width and height [m] of the floor that a plan needs, in its start frame, with the margin around it."""
        width, height = plan.floor_m
        return width + 2.0 * self.margin_m, height + 2.0 * self.margin_m

    @property
    def plans(self) -> list[Plan]:
        """The plans that can be driven."""
        return [row.plan for row in self.rows if row.plan is not None]

    @property
    def problems(self) -> list[PlanError]:
        """Why the others cannot: each reason once, though several conditions may have it."""
        return _once(row.problem for row in self.rows if row.problem is not None)

    @property
    def unsuited(self) -> list[PlanError]:
        """Those of the `problems` that no floor and no start would solve: the vehicle lacks what is needed."""
        return [problem for problem in self.problems if isinstance(problem, UnsuitedVehicleError)]

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return self.repeats * len(self.plans)

    @property
    def driving_s(self) -> float:
        """Time under commands, all repeats together [s]."""
        return self.repeats * sum(plan.duration_s for plan in self.plans)

    @property
    def total_s(self) -> float:
        """Time for the campaign, with what passes between runs [s]."""
        return self.driving_s + self.runs * self.between_runs_s

    @property
    def floor_m(self) -> tuple[float, float]:
        """Width and height [m] of the floor on which each plan has room, in its start frame, with the margin."""
        widths, heights = zip(*map(self.floor_of, self.plans), strict=True) if self.plans else ([0.0], [0.0])
        return max(widths), max(heights)


def _once(problems: Iterable[PlanError]) -> list[PlanError]:
    return list({str(problem): problem for problem in problems}.values())


def dry_run(
    trajectories: Sequence[Trajectory],
    models: Mapping[str, VehicleModel],
    *,
    repeats: int = 1,
    workspace: Workspace | None = None,
    start: Pose | None = None,
    between_runs_s: float = BETWEEN_RUNS_S,
) -> DryRun:
    """Plan every trajectory under every condition that it and `models` (by condition) have, and drive nothing.

    `workspace` and `start` are those of `plan`.
    """
    rows = [
        _row(trajectory, condition, model, workspace, start)
        for trajectory in trajectories
        for condition, model in models.items()
        if condition in trajectory.conditions
    ]
    margin_m = DEFAULT_MARGIN_M if workspace is None else workspace.margin_m
    return DryRun(tuple(rows), repeats, between_runs_s, margin_m)


def _row(
    trajectory: Trajectory, condition: str, model: VehicleModel, workspace: Workspace | None, start: Pose | None
) -> DryRunRow:
    # A corrected plan compensates for the model's effects, and is what a bench would drive.
    made = corrected_plan if condition == "corrected" else plan
    try:
        return DryRunRow(trajectory, condition, made(trajectory, model, workspace=workspace, start=start), None)
    except PlanError as problem:
        return DryRunRow(trajectory, condition, None, problem)
