"""A bench session on the console: the table of a dry run, and the summary when it is done."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from agvbench.errors import AgvbenchError
from agvbench.metrics.table import write_metrics
from agvbench.planning import Plan
from agvbench.planning.workspace import DEFAULT_MARGIN_M
from agvbench.reporting.console.sequential import decision_in_words, sequential_summary
from agvbench.reporting.console.tables import (
    end_pose_summary,
    print_comparison,
    print_gate,
    print_warnings,
    said_first,
)
from agvbench.reporting.write import write_report
from agvbench.running.execution.campaign_time import TURNAROUND_S
from agvbench.running.execution.drive import DEFAULT_TIMING
from agvbench.running.execution.run_records import RunRequest
from agvbench.statistics.quantities import DEFINITIONS
from agvbench.workflows.comparison.judged_bench import JudgedBench
from agvbench.workflows.comparison.sequential_record import SequentialRecord
from agvbench.workflows.report import ReportData, gather

_NARROWEST = 100


def as_text(renderable: RenderableType) -> str:
    """Return `renderable` as lines without colours: as wide as ``COLUMNS`` says, else as the terminal, at least 100."""
    console = _console()
    console.print(renderable)
    return _printed(console)


def _console() -> Console:
    columns = shutil.get_terminal_size((_NARROWEST, 24)).columns
    width = columns if os.environ.get("COLUMNS", "").isdigit() else max(_NARROWEST, columns)
    return Console(file=io.StringIO(), width=width, no_color=True)


def _printed(console: Console) -> str:
    file = console.file
    assert isinstance(file, io.StringIO)  # noqa: S101 - it is the one made above
    return file.getvalue().rstrip("\n")


_AT_REST_S = DEFAULT_TIMING.rest_before_s + DEFAULT_TIMING.settle_s
_BETWEEN_S = _AT_REST_S + TURNAROUND_S
_NAMES = ("experiment", "trajectory", "condition")
_NUMBERS = ("runs", "longest\n[s]", "driving\n[min]", "between\n[min]", "total\n[min]", "floor\n[m]")


def dry_run_table(planned: Sequence[tuple[RunRequest, Plan]]) -> str:
    """Return the table as text: a row for each experiment, trajectory and condition, and the sum of each column.

    Times are those of the plans; beside them stands what passes between two runs.
    """
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_footer=bool(planned), caption_justify="left")
    table.collapse_padding = True
    table.title, table.caption = "What would be driven", _caption(planned)
    for column, total in zip(_NAMES, ("total", "", ""), strict=True):
        table.add_column(column, footer=total, overflow="fold")
    for column, total in zip(_NUMBERS, _times([plan for _, plan in planned]), strict=True):
        table.add_column(Text(column), footer=Text(total), justify="right", no_wrap=True)
    for names, plans in _by_kind(planned).items():
        table.add_row(*map(Text, names), *map(Text, _times(plans)))
    return as_text(table)


def _by_kind(planned: Sequence[tuple[RunRequest, Plan]]) -> dict[tuple[str, str, str], list[Plan]]:
    kinds: dict[tuple[str, str, str], list[Plan]] = {}
    for request, plan in planned:
        kinds.setdefault((request.experiment, request.trajectory or "–", request.condition), []).append(plan)
    return kinds


def _times(plans: Sequence[Plan]) -> tuple[str, ...]:
    """Return the cells of these plans under the headings of numbers."""
    durations = [plan.duration_s for plan in plans]
    driving_s, between_s = sum(durations), _BETWEEN_S * len(plans)
    minutes = (f"{seconds / 60.0:.1f}" for seconds in (driving_s, between_s, driving_s + between_s))
    floor = " × ".join(
        f"{max(sides) + 2.0 * DEFAULT_MARGIN_M:.2f}" for sides in zip(*(plan.floor_m for plan in plans), strict=True)
    )
    return str(len(plans)), f"{max(durations, default=0.0):.1f}", *minutes, floor


def _caption(planned: Sequence[tuple[RunRequest, Plan]]) -> str:
    if not planned:
        return "nothing"
    radius_m = max(_reach(request, plan) for request, plan in planned)
    total_s = sum(plan.duration_s + _BETWEEN_S for _, plan in planned)
    return (
        f"{len(planned)} runs, {total_s / 3600.0:.1f} h: driving, and {_BETWEEN_S:g} s between two runs "
        f"({_AT_REST_S:g} s at rest, about {TURNAROUND_S:g} s for the return path to the start); "
        f"the vehicle stays within {radius_m:.2f} m of the floor's origin, "
        f"with {DEFAULT_MARGIN_M:.2f} m around its axles"
    )


def _reach(request: RunRequest, plan: Plan) -> float:
    """Return how far from the floor's origin a run leads the vehicle [m]."""
    import numpy as np

    start, path = request.start, plan.expected
    turn = np.exp(1j * start.heading_rad)
    floor = complex(start.x_m, start.y_m) + turn * (path[:, 1] + 1j * path[:, 2])
    longest_axle = max(plan.geometry.front_axle_m, abs(plan.geometry.rear_axle_m))
    return float(np.abs(floor).max() + longest_axle + DEFAULT_MARGIN_M)


def bench_summary(directory: Path, *, report: bool) -> tuple[str, bool]:
    """Return the summary of the campaign in `directory`, after writing its report where that is wanted.

    What cannot be reported is said, not raised: the campaign is recorded all the same. The second value is whether
    everything could be reported.
    """
    try:
        if not report:
            data, defined = gather(directory), Text(f"{DEFINITIONS}\n")
            write_metrics(directory, data.metrics)
            where = [*_failures(data), Text(f"campaign: {directory}")]
            return as_text(Group(*_end_poses(data, defined), *where)), not data.failures
        written = write_report(directory)
    except AgvbenchError as error:
        return f"no report: {error}\ncampaign: {directory}", False
    where = [*_failures(written.data), Text(f"campaign: {directory}"), Text(f"report:   {written.files[0]}")]
    text = as_text(Group(*_end_poses(written.data), *said_first(written), Text(""), *where))
    return text, not written.data.failures


def _failures(data: ReportData) -> list[Text]:
    return [Text(f"metric {name} is left out: {error}") for name, error in data.failures.items()]


def sequential_text(record: SequentialRecord, driven: int, saved: int) -> str:
    """Return a sequential comparison: its verdicts, what was decided, and how many runs that took and saved."""
    return as_text(Group(sequential_summary(record), Text(decision_in_words(record, driven, saved))))


def judged_text(judged: JudgedBench) -> str:
    """Return the comparison and the gate of a bench, as ``agvbench compare`` prints them."""
    console = _console()
    print_warnings(console, judged.known.sentences)
    print_comparison(console, judged.comparison)
    print_gate(console, judged.checks)
    return _printed(console)


def _end_poses(data: ReportData, *below: RenderableType) -> list[RenderableType]:
    """Return the table of end poses and what stands below it, or nothing where no run had a target."""
    return [end_pose_summary(data), *below] if len(data.end_poses) else []
