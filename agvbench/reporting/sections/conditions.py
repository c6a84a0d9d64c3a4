"""Every condition against the next: difference, interval, test, effect size, verdict."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.comparison_table import comparison_table
from agvbench.reporting.content import Block, Paragraph
from agvbench.reporting.sections.base import Section
from agvbench.workflows.report import ReportData


class Conditions(Section):
    """One table per pair of conditions."""

    slug, title, order = "conditions", "Conditions compared", 20

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the tables, or why there are none."""
        if not data.comparisons:
            return [Paragraph("No trajectory was driven under two conditions: nothing to compare.")]
        return [
            comparison_table(comparison, f"comparison-{index}") for index, comparison in enumerate(data.comparisons, 1)
        ]
