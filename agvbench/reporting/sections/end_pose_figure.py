"""End poses in the target frame, trajectory by trajectory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from agvbench.plot.style import condition_numbers
from agvbench.plot.target_frame import draw_ends, ends_by_condition
from agvbench.reporting.content import Block, FigureBlock, Panel, Paragraph
from agvbench.reporting.figures.style import ON_PAGE, dress, legend, new_panel, panel_title, to_svg
from agvbench.reporting.sections.base import Section
from agvbench.statistics import valid
from agvbench.types import Floats, Pose
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import pandas as pd

_POSE = ("x_m", "y_m", "heading_rad")
_CAPTION = (
    "Where runs ended, seen from the target: ahead to the right, left upwards. Each line points along the heading "
    "reached (horizontal is right); large hollow markers are medians."
)


class EndPoseFigureSection(Section):
    """A panel per trajectory."""

    slug, title, order = "end-pose-figure", "End poses seen from the target", 40

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the figure, or why there is none."""
        counted, numbers = valid(data.errors), condition_numbers(data.conditions)
        if counted.empty:
            return [Paragraph("No end pose to draw.")]
        named = legend({c: n for c, n in numbers.items() if c in set(counted["condition"])})
        return [FigureBlock("end-pose-figure", _CAPTION, list(_panels(counted, numbers)), named)]


def _panels(counted: pd.DataFrame, numbers: dict[str, int]) -> Iterator[Panel]:
    for index, (name, rows) in enumerate(counted.groupby("trajectory", sort=False)):
        target = Pose(*rows[[f"target_{axis}" for axis in _POSE]].iloc[0])
        yield Panel(panel_title(str(name), target), _drawing(ends_by_condition(rows, numbers), f"end-pose-{index}"))


def _drawing(ends: Mapping[int, Floats], name: str) -> str:
    figure = new_panel(3.1, 2.9)
    axes = figure.add_subplot()
    dress(axes, x="ahead of target [mm]", y="left of target [mm]")
    draw_ends(axes, ends, ON_PAGE)
    return to_svg(figure, name)
