"""What changed since the campaign before: recorded facts, and medians of metrics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from agvbench.metrics.registry import in_registry_order, title_of
from agvbench.reporting.content import Block, Column, Paragraph, Table, plain
from agvbench.reporting.sections.base import Section
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = (
    Column("name", "what"),
    Column("before", "before"),
    Column("value", "now"),
)
_MEDIANS = (
    "Medians of absolute values over the runs that count, of the trajectories that both campaigns drove. "
    "Whether a difference is more than chance says agvbench compare."
)
_MEDIAN_COLUMNS = (
    Column("metric", "metric"),
    Column("unit", "unit"),
    Column("condition", "condition"),
    Column("runs_before", "n before", 0),
    Column("before", "before", 2),
    Column("runs_now", "n now", 0),
    Column("now", "now", 2),
    Column("difference", "difference", 2),
)
_MEDIAN_FIELDS = [
    "title", "unit", "condition", "runs_before", "median_before", "runs_now", "median_now", "difference",
]  # fmt: skip


class ChangesSection(Section):
    """A table of the facts that both campaigns record and that differ, and one of the medians of both."""

    slug, title, order = "changes", "What changed", 15

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the tables, or that nothing changed, or that there is nothing to compare with."""
        if (changes := data.changes) is None:
            return [Paragraph("The folder holds no earlier campaign of this vehicle (--against names another one).")]
        before = f"{plain(changes.before.name)}, driven {changes.driven:%Y-%m-%d %H:%M} UTC"
        rows = [[name, was or "none", value or "none"] for name, was, value in changes.differences]
        facts = Table("changes", f"What differs from the campaign before: {before}.", _COLUMNS, rows)
        nothing = Paragraph(f"No setting, file or label that is recorded differs from {before}.", lead=True)
        return [facts if rows else nothing, *_medians(changes.medians)]


def _medians(medians: pd.DataFrame) -> Iterator[Block]:
    """Yield the table of medians, if there are any."""
    order = {name: index for index, name in enumerate(in_registry_order(medians["metric"]))}
    table = medians.assign(
        title=medians["metric"].map(title_of), difference=medians["median_now"] - medians["median_before"]
    ).sort_values("metric", key=lambda names: names.map(order), kind="stable")
    rows = table[_MEDIAN_FIELDS].to_numpy(dtype=object).tolist()
    if rows:
        yield Table("medians", _MEDIANS, _MEDIAN_COLUMNS, rows, grouped=True)
