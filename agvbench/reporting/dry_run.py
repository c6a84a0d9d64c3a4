"""The table of a dry run: what would be driven, for how long, on how much floor."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.planning import Plan
from agvbench.planning.workspace import DEFAULT_MARGIN_M
from agvbench.running.campaign_time import TURNAROUND_S
from agvbench.running.drive import DEFAULT_TIMING
from agvbench.running.records import DriveOrder

_AT_REST_S = DEFAULT_TIMING.rest_before_s + DEFAULT_TIMING.settle_s


def dry_run_table(planned: Sequence[tuple[DriveOrder, Plan]]) -> str:
    """Return the table as text: a row for each experiment, trajectory and condition, and the sum.

    Times are those of the plans, with the rests around each run and the way back to the start.
    """
    from rich.table import Table
    from rich.text import Text

    from agvbench.reporting.text import as_text

    cells: dict[tuple[str, str, str], list[Plan]] = {}
    for order, plan in planned:
        cells.setdefault((order.experiment, order.trajectory, order.condition), []).append(plan)
    table = Table(title="What would be driven", caption=_sum(planned), caption_justify="left")
    for column in ("experiment", "trajectory", "condition"):
        table.add_column(column)
    for column in ("runs", "each [s]", "all [min]", "floor [m]"):
        table.add_column(Text(column), justify="right")
    for (experiment, trajectory, condition), plans in cells.items():
        longest = max(plan.duration_s for plan in plans)
        floor = " × ".join(
            f"{max(sides) + 2.0 * DEFAULT_MARGIN_M:.2f}"
            for sides in zip(*(plan.floor_m for plan in plans), strict=True)
        )
        minutes = _total_s(plans) / 60.0
        table.add_row(
            *map(Text, (experiment, trajectory or "–", condition, str(len(plans)))),
            *map(Text, (f"{longest:.1f}", f"{minutes:.1f}", floor)),
        )
    return as_text(table)


def _sum(planned: Sequence[tuple[DriveOrder, Plan]]) -> str:
    if not planned:
        return "nothing"
    plans = [plan for _, plan in planned]
    radius_m = max(_reach(order, plan) for order, plan in planned)
    hours = _total_s(plans) / 3600.0
    return (
        f"{len(plans)} runs, {hours:.1f} h with the way back to the start; "
        f"the vehicle stays within {radius_m:.2f} m of the floor's origin, "
        f"with {DEFAULT_MARGIN_M:.2f} m around its axles"
    )


def _total_s(plans: Sequence[Plan]) -> float:
    return sum(plan.duration_s + _AT_REST_S + TURNAROUND_S for plan in plans)


def _reach(order: DriveOrder, plan: Plan) -> float:
    """Return how far from the floor's origin a run leads the vehicle [m]."""
    import numpy as np

    start, path = order.start, plan.expected
    turn = np.exp(1j * start.heading_rad)
    floor = complex(start.x_m, start.y_m) + turn * (path[:, 1] + 1j * path[:, 2])
    longest_axle = max(plan.geometry.front_axle_m, plan.geometry.rear_axle_m)
    return float(np.abs(floor).max() + longest_axle + DEFAULT_MARGIN_M)
