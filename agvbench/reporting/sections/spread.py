"""Accuracy (bias) apart from repeatability (spread)."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.content import Block, Column, Paragraph, Table
from agvbench.reporting.sections.base import Section
from agvbench.statistics.quantities import COMPONENT_DEFINITIONS
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("trajectory", "trajectory"),
    Column("condition", "condition"),
    Column("component", "component"),
    Column("repeats", "n", 0),
    Column("bias", "median", 2, group="accuracy (bias)"),
    Column("bias_low", "95 % from", 2, group="accuracy (bias)"),
    Column("bias_high", "to", 2, group="accuracy (bias)"),
    Column("sd", "sd", 2, group="repeatability (spread)"),
    Column("sd_low", "95 % from", 2, group="repeatability (spread)"),
    Column("sd_high", "to", 2, group="repeatability (spread)"),
    Column("robust_sd", "from MAD", 2, group="repeatability (spread)"),
)
_CAPTION = "Signed errors: what calibration can remove (bias), and what no model can (spread between repeats)."
_NOTE = (
    f"{COMPONENT_DEFINITIONS} Bias intervals by bootstrap, intervals of the standard deviation after Bonett; "
    "fewer than three and five repeats have none."
)


class SpreadSection(Section):
    """One table, headed by trajectory."""

    slug, title, order = "spread", "Accuracy and repeatability", 70

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table, or why there is none."""
        if data.spread.empty:
            return [Paragraph("No errors to take apart.")]
        rows = [[row[c.name] for c in _COLUMNS] for row in data.spread.to_dict("records")]
        return [Table("accuracy_and_repeatability", _CAPTION, _COLUMNS, rows, grouped=True, note=_NOTE)]
