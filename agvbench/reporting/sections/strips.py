"""Every run's end position error, heading error and Δs, by trajectory and condition."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.reporting.content import Block, FigureBlock, Panel, Paragraph
from agvbench.reporting.figures.labels import condition_numbers, legend
from agvbench.reporting.figures.strips import Strip, draw_strips
from agvbench.reporting.sections.base import Section
from agvbench.statistics import valid
from agvbench.statistics.end_poses import CASES
from agvbench.statistics.quantities import HEADING, QUANTITIES, ROTATION, Quantity
from agvbench.workflows.report import ReportData

_CAPTION = "One point per run, heading error and Δs signed; the bar is the median."
_CAPTION_THESIS = (
    " Hollow diamonds are the thesis' medians, which were published without sign for distances and straight drives: "
    "both readings are drawn."
)


class StripsSection(Section):
    """One figure per quantity."""

    slug, title, order = "strips", "Every run", 50

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the figures, or why there are none."""
        if valid(data.errors).empty:
            return [Paragraph("No errors to draw.")]
        numbers = condition_numbers(data.conditions)
        compared = bool(data.end_poses["published_median"].notna().any())
        caption = _CAPTION + _CAPTION_THESIS if compared else _CAPTION
        panels = [
            Panel(
                f"{q.symbol} [{q.unit}]",
                draw_strips(_strips(data, q, numbers), f"strips-{q.column}", label=f"{q.symbol} [{q.unit}]"),
            )
            for q in QUANTITIES
        ]
        return [FigureBlock("strips", caption, panels, legend(numbers), wide=True)]


def _strips(data: ReportData, quantity: Quantity, numbers: dict[str, int]) -> list[Strip]:
    counted = valid(data.errors)
    rows_of = [quantity.column, ROTATION.column] if quantity is HEADING else [quantity.column]
    published = data.end_poses[data.end_poses["quantity"].isin(rows_of) & data.end_poses["published_median"].notna()]
    medians = {
        (row["trajectory"], row["condition"]): _both_readings(row["published_median"], row["reading"], row["case"])
        for row in published.to_dict("records")
    }
    strips = []
    for name in dict.fromkeys(counted["trajectory"]):
        for condition, number in numbers.items():
            rows = counted[(counted["trajectory"] == name) & (counted["condition"] == condition)]
            if len(rows):
                values = rows[quantity.column].to_numpy(dtype=float)
                strips.append(Strip(str(name), number, values, medians.get((name, condition), ())))
    return strips


def _both_readings(median: float, reading: str, case: float) -> Sequence[float]:
    """Return the signed errors that a published median may mean."""
    if reading == "rotation":
        target = CASES[int(case)].heading_rad
        return (float(np.sign(target)) * (median - abs(np.degrees(target))),)
    return (-median, median)
