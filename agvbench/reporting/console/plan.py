"""Plans without driving: on the console, as JSON, and their commands as CSV."""

from __future__ import annotations

import json
import math

from rich.console import Console
from rich.table import Table
from rich.text import Text

from agvbench.planning import DryRun, DryRunRow, Plan
from agvbench.reporting.content import plain
from agvbench.types import Pose

_WIDE = 120


def print_dry_run(made: DryRun, console: Console) -> None:
    """Print a dry run as a table: time, floor, target and start of each trajectory, and the hours in total."""
    console.print(_table(made, wide=console.width >= _WIDE))
    width, height = made.floor_m
    console.print(
        f"{made.runs} runs: {_duration(made.driving_s)} driving, {_duration(made.total_s)} with "
        f"{made.between_runs_s:g} s between runs; largest floor {width:.2f} m × {height:.2f} m, "
        f"with {made.margin_m:.2f} m around the axles for the vehicle",
        highlight=False,
        soft_wrap=True,
    )


def _table(made: DryRun, *, wide: bool) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for column in ("trajectory", "condition", "time s", "floor m", "target m m °", "start m m °"):
        table.add_column(column, justify="left" if column in ("trajectory", "condition") else "right", no_wrap=True)
    if wide:
        table.add_column("what")
    for row in made.rows:
        table.add_row(*map(Text, _cells(row, made)[: len(table.columns)]))
    return table


def _cells(row: DryRunRow, of: DryRun) -> list[str]:
    names, description = [row.trajectory.name, row.condition], plain(row.trajectory.description)
    if row.plan is None:
        return [*names, "cannot", "–", "–", "–", description]
    made = row.plan
    width, height = of.floor_of(made)
    target = _pose(made.target) if made.target.is_finite else "none"
    floor = f"{width:.2f}×{height:.2f}"
    return [*names, f"{made.duration_s:.2f}", floor, target, _pose(made.start), description]


def _pose(pose: Pose) -> str:
    # Adding zero turns −0.00 into 0.00.
    x, y, heading = (round(v, 2) + 0.0 for v in (pose.x_m, pose.y_m, math.degrees(pose.heading_rad)))
    return f"{x:.2f} {y:.2f} {heading:.0f}°"


def _duration(seconds: float) -> str:
    if seconds < 3600.0:
        return f"{seconds / 60.0:.1f} min"
    return f"{seconds / 3600.0:.1f} h"


def to_json(made: DryRun) -> str:
    """Return a dry run as JSON, for other programs."""
    rows = [
        {"trajectory": row.trajectory.name, "condition": row.condition, "problem": row.problem and str(row.problem)}
        | (_plan_table(row.plan, made) if row.plan else {})
        for row in made.rows
    ]
    total = {"runs": made.runs, "driving_s": made.driving_s, "total_s": made.total_s, "floor_m": made.floor_m}
    return json.dumps({"schema": 1, "rows": rows, "total": total}, indent=2)


def _plan_table(made: Plan, of: DryRun) -> dict[str, object]:
    target = made.target._asdict() if made.target.is_finite else None
    return {
        "duration_s": made.duration_s,
        "floor_m": of.floor_of(made),
        "target": target,
        "start": made.start._asdict(),
    }


def commands_csv(made: DryRun) -> str:
    """Return the commands of every plan as CSV, with the columns of a campaign's commands and which plan it is."""
    lines = ["trajectory,condition,t_s,drive,front,rear"]
    for row in made.rows:
        if row.plan is not None:
            commands = row.plan.commands
            for i in range(len(commands)):
                values = (float(commands.t_s[i]), *commands.at(i))
                numbers = ",".join(f"{value:.6g}" for value in values)
                lines.append(f"{row.trajectory.name},{row.condition},{numbers}")
    return "\n".join(lines)
