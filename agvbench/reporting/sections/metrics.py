"""Errors along the path and every further metric, by trajectory and condition: quartiles over repeats."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from agvbench.metrics.registry import all_metrics, in_registry_order, title_of
from agvbench.reporting.content import Block, Column, Paragraph, Table, Value, plain
from agvbench.reporting.sections.base import Section
from agvbench.statistics.descriptive import five_numbers
from agvbench.statistics.end_poses import in_order
from agvbench.types import RUN_OK
from agvbench.workflows.report import ReportData

_SHOWN_ELSEWHERE = frozenset({"position_error", "heading_error", "along_error", "across_error", "delta_s"})
_COLUMNS = (
    Column("trajectory", "trajectory"),
    Column("metric", "metric"),
    Column("unit", "unit"),
    Column("condition", "condition"),
    Column("repeats", "n", 0),
    Column("min", "MIN", 2),
    Column("q1", "Q1", 2),
    Column("median", "MED", 2),
    Column("q3", "Q3", 2),
    Column("max", "MAX", 2),
)
_CAPTION = "Errors along the path, time, and the lab's own metrics: absolute values over the runs that count."


class MetricsSection(Section):
    """One table, headed by trajectory, and the definitions of its metrics."""

    slug, title, order = "metrics", "Along the path", 65

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table, or why there is none."""
        rows = list(_rows(data))
        if not rows:
            return [Paragraph("No run has a planned path, or another metric than those of its end pose.")]
        known = all_metrics()
        named = in_registry_order(data.metrics["metric"])
        said = [
            f"{title_of(m)}: {plain(known[m].definition)}" for m in named if m in known and m not in _SHOWN_ELSEWHERE
        ]
        return [Table("metrics", _CAPTION, _COLUMNS, rows, grouped=True, note=" ".join(said))]


def _rows(data: ReportData) -> Iterator[list[Value]]:
    table = data.metrics
    counted = table[(table["status"] == RUN_OK) & ~table["metric"].isin(_SHOWN_ELSEWHERE)]
    for trajectory, of_trajectory in counted.groupby("trajectory", sort=False):
        for metric in in_registry_order(of_trajectory["metric"]):
            group = of_trajectory[of_trajectory["metric"] == metric]
            unit = str(group["unit"].iloc[0])
            for condition in in_order(group["condition"]):
                values = np.abs(group["value"][group["condition"] == condition].to_numpy(dtype=float))
                yield [str(trajectory), title_of(metric), unit, condition, len(values), *five_numbers(values)]
