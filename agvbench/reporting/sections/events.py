"""What adapters and link reported while the campaign was driven."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.content import Block, Column, Paragraph, Table, Value
from agvbench.reporting.sections.base import Section
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("source", "source"),
    Column("level", "level"),
    Column("event", "event"),
    Column("events", "events", 0),
    Column("runs", "runs", 0),
    Column("last", "the last"),
)


class EventsSection(Section):
    """A row for each kind of event."""

    slug, title, order = "events", "Events", 95

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table, or that there is nothing to show."""
        if not len(data.events):
            return [Paragraph("No events were recorded.")]
        rows: list[list[Value]] = []
        for (source, level, event), group in data.events.groupby(["source", "level", "event"], sort=False):
            runs = int(group["run_id"][group["run_id"] != ""].nunique())
            rows.append([str(source), str(level), str(event), len(group), runs, str(group["text"].iloc[-1])])
        return [
            Table("events", "What adapters and link reported, by kind; runs during which they did.", _COLUMNS, rows)
        ]
