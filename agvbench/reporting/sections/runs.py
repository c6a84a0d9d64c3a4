"""Every run by trajectory: its errors, its status, and the file of its recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from agvbench.plot.driven_paths import drawn_path, from_start
from agvbench.reporting.content import Block, Column, Fold, Paragraph, Table, Value, plain
from agvbench.reporting.figures.clouds import sketch
from agvbench.reporting.figures.style import panel_title
from agvbench.reporting.sections.base import Section
from agvbench.types import Run
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("run_id", "run"),
    Column("condition", "condition"),
    Column("repeat", "repeat", 0),
    Column("started_s", "started [s]", 0, explained="Since the campaign began."),
    Column("position_mm", "end position error [mm]", 1),
    Column("heading_deg", "heading error [deg]", 2),
    Column("delta_s_mm", "Δs [mm]", 1),
    Column("value", "status"),
)
_ERRORS = ("position_mm", "heading_deg", "delta_s_mm")
_WHERE = (
    "Each run links to the file of its poses. The Rerun viewer shows all of them (rerun campaign.rrd): a tab per "
    "trajectory, in it one per condition, in it one per run."
)


class RunsSection(Section):
    """A fold per trajectory, with a sketch of the way, and a table of its runs."""

    slug, title, order = "runs", "Runs", 62

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the folds."""
        errors = {str(row["run_id"]): row for row in data.errors.to_dict("records")}
        by_kind: dict[tuple[str, str], list[Run]] = {}
        for run in sorted(data.runs, key=lambda run: not run.target.is_finite):
            by_kind.setdefault(("", run.trajectory) if run.target.is_finite else (run.experiment, ""), []).append(run)
        folds = [
            Fold(_summary(kind, runs), [_table(f"runs-{index}", runs, errors, data)], _sketch(runs))
            for index, (kind, runs) in enumerate(by_kind.items(), 1)
        ]
        return [Paragraph(_WHERE, lead=False), *folds]


def _summary(kind: tuple[str, str], runs: Sequence[Run]) -> str:
    title = panel_title(kind[1], runs[0].target) or plain(kind[0]) or "no trajectory"
    bad = sum(not run.is_ok for run in runs)
    count = f"{len(runs)} {'runs' if len(runs) > 1 else 'run'}"
    return f"{title} · {count}{f', {bad} do not count' if bad else ''}"


def _table(slug: str, runs: Sequence[Run], errors: Mapping[str, Mapping[Any, Any]], data: ReportData) -> Table:
    shown = [column for column in _COLUMNS if runs[0].target.is_finite or column.name not in _ERRORS]
    rows = [[cells[c.name] for c in shown] for run in runs for cells in [_cells(run, errors.get(run.run_id, {}))]]
    files = [data.recordings[run.run_id] for run in runs]
    return Table(slug, "Runs in the order in which they were driven.", shown, rows, files=files)


def _cells(run: Run, errors: Mapping[Any, Any]) -> dict[str, Value]:
    problem = str(errors.get("problem", ""))
    status = f"no error: {problem}" if run.is_ok and problem else run.status
    named = {"run_id": run.run_id, "condition": run.condition, "repeat": run.repeat, "started_s": run.started_s}
    return {**named, **{name: errors.get(name, math.nan) for name in _ERRORS}, "value": status}


def _sketch(runs: Sequence[Run]) -> str:
    """Return a sketch of the way of the first run that counts and has frames; "" without one."""
    for run in runs:
        if run.is_ok and len(path := drawn_path(run.frames)) > 1:
            return sketch(from_start(path)[:, 1:3])
    return ""
