"""What changed since the campaign before."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.content import Block, Column, Paragraph, Table, plain
from agvbench.reporting.sections.base import Section
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("name", "what"),
    Column("before", "before"),
    Column("value", "now"),
)


class ChangesSection(Section):
    """A table of the facts that both campaigns record and that differ."""

    slug, title, order = "changes", "What changed", 15

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table, or that nothing changed, or that there is nothing to compare with."""
        if (changes := data.changes) is None:
            return [Paragraph("The folder holds no earlier campaign of this vehicle (--against names another one).")]
        before = f"{plain(changes.before.name)}, driven {changes.driven:%Y-%m-%d %H:%M} UTC"
        if not changes.differences:
            return [Paragraph(f"Nothing that is recorded differs from {before}.", lead=True)]
        rows = [[name, was or "none", value or "none"] for name, was, value in changes.differences]
        return [Table("changes", f"What differs from the campaign before: {before}.", _COLUMNS, rows)]
