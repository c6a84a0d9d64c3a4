"""Every condition against the next: difference, interval, test, effect size, verdict."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.comparison_table import comparison_table, shift_table
from agvbench.reporting.content import Block, Paragraph
from agvbench.reporting.sections.base import Section
from agvbench.workflows.report import ReportData


class Conditions(Section):
    """Two tables per pair of conditions: errors with verdicts, and the shift of the mean end position."""

    slug, title, order = "conditions", "Conditions compared", 20

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the tables, or why there are none."""
        if not data.comparisons:
            return [Paragraph("No trajectory was driven under two conditions: nothing to compare.")]
        return [
            table(comparison, f"{slug}-{index}")
            for index, comparison in enumerate(data.comparisons, 1)
            for slug, table in (("comparison", comparison_table), ("end-shift", shift_table))
        ]
