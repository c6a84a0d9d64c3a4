"""MIN, Q1, MED, Q3, MAX per trajectory, as tables 8.3–8.10 of the thesis, with the thesis' values beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from agvbench.reporting.content import Block, Column, Paragraph, Table, Value
from agvbench.reporting.sections.base import Section
from agvbench.statistics.end_poses import STATISTICS
from agvbench.workflows.report import ReportData

_TITLES = {"min": "MIN", "q1": "Q1", "median": "MED", "q3": "Q3", "max": "MAX"}


class EndPosesSection(Section):
    """One table, headed by trajectory."""

    slug, title, order = "end-poses", "End poses", 30

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table, or why there is none."""
        rows = [_row(row) for row in data.end_poses.to_dict("records")]
        if not rows:
            return [Paragraph("No run has a target and a measured end pose.")]
        compared = bool(data.end_poses["published_median"].notna().any())
        columns = [
            Column("trajectory", "trajectory"),
            Column("reading", "error"),
            Column("unit", "unit"),
            Column("condition", "condition"),
            Column("repeats", "n", 0),
            *(Column(s, _TITLES[s], 2, group="this campaign") for s in STATISTICS),
            Column("outliers", "outliers", 0, group="this campaign"),
            *(Column(f"published_{s}", _TITLES[s], 2, group="thesis, tables 8.3–8.10") for s in STATISTICS),
        ]
        if not compared:
            columns, rows = columns[:11], [row[:11] for row in rows]
        note = _NOTE + _NOTE_THESIS if compared else _NOTE
        return [Table("end_poses", _CAPTION, columns, rows, grouped=True, note=note)]


_CAPTION = "Absolute errors of end position and heading, |Δs|, and the rotation made in turns, as in the thesis."
_NOTE = (
    "Quartiles interpolate linearly. Outliers lie beyond 1.5 interquartile ranges from the quartiles; they are "
    "counted, not dropped."
)
_NOTE_THESIS = " The thesis drove one vehicle ten times per row; it has no end position errors."


def _row(row: dict[Any, Any]) -> list[Value]:
    case = "" if row["case"] != row["case"] or row["case"] is None else f" · thesis trajectory {int(row['case'])}"
    return [
        f"{row['trajectory']}{case}",
        row["reading"],
        "mm" if str(row["quantity"]).endswith("_mm") else "deg",
        row["condition"],
        row["repeats"],
        *(row[s] for s in STATISTICS),
        row["outliers"],
        *(row[f"published_{s}"] for s in STATISTICS),
    ]
