"""Every run's end position error, heading error and Δs, by trajectory and condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.plot.style import colour, condition_numbers, literal, marker
from agvbench.reporting.content import Block, FigureBlock, Panel, Paragraph, plain
from agvbench.reporting.figures.style import INK, MUTED, PAPER, dress, legend, new_figure, to_svg
from agvbench.reporting.sections.base import Section
from agvbench.statistics import valid
from agvbench.statistics.end_poses import CASES
from agvbench.statistics.quantities import HEADING, QUANTITIES, ROTATION, Quantity
from agvbench.types import Floats
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


_ROW_IN, _BETWEEN = 0.2, 0.45
_LONGEST = 26


@dataclass(frozen=True)
class Strip:
    """One line: its trajectory, the number of its condition, signed errors of shape (n,), and published medians."""

    trajectory: str
    condition: int
    values: Floats
    published: Sequence[float]


def draw_strips(strips: Sequence[Strip], name: str, *, label: str) -> str:
    """Return an SVG with one line per strip, grouped by trajectory; zero is where every run should be.

    The thesis' medians, published without sign, are hollow diamonds on every side they may belong to.
    """
    heights, ticks = _layout(strips)
    figure = new_figure(6.4, 0.75 + _ROW_IN * (max(heights, default=0.0) + 1.0))
    axes = figure.add_subplot()
    dress(axes, x=label, y="", size=9.0)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    for strip, height in zip(strips, heights, strict=True):
        _draw(axes, strip, height)
    axes.set_yticks([position for position, _ in ticks], [text for _, text in ticks])
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(max(heights, default=0.0) + 0.8, -0.8)
    axes.margins(x=0.04)
    return to_svg(figure, name)


def _layout(strips: Sequence[Strip]) -> tuple[list[float], list[tuple[float, str]]]:
    heights: list[float] = []
    groups: dict[str, list[float]] = {}
    for strip in strips:
        new = strip.trajectory not in groups
        below = heights[-1] + 1.0 + (_BETWEEN if new else 0.0) if heights else 0.0
        heights.append(below)
        groups.setdefault(strip.trajectory, []).append(below)
    return heights, [(float(np.mean(at)), _short(name)) for name, at in groups.items()]


def _short(name: str) -> str:
    """Return a name that fits beside the figure, with dollar signs that begin no formula."""
    text = plain(name)
    return literal(text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…")


def _draw(axes: Axes, strip: Strip, height: float) -> None:
    # Ties and near ties are spread by rank, the same way every time.
    jitter = 0.22 * np.sin(2.4 * np.arange(len(strip.values)))
    shown = colour(strip.condition)
    axes.plot(
        strip.values,
        height + jitter,
        linestyle="none",
        marker=marker(strip.condition),
        markersize=4,
        color=shown,
        markeredgecolor=PAPER,
        markeredgewidth=0.5,
    )
    middle = float(np.median(strip.values))
    axes.plot([middle, middle], [height - 0.42, height + 0.42], color=INK, linewidth=1.6)
    if strip.published:
        axes.plot(
            strip.published,
            np.full(len(strip.published), height),
            linestyle="none",
            marker="D",
            markersize=5,
            markerfacecolor="none",
            markeredgecolor=MUTED,
            markeredgewidth=1.0,
        )
