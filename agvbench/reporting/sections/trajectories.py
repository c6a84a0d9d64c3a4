"""The ways that were driven: over the floor, and trajectory by trajectory from the start pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from agvbench.plot.driven_paths import draw_group, draw_start_and_target, drawn_path, from_start, tip
from agvbench.plot.style import condition_numbers
from agvbench.reporting.content import Block, FigureBlock, Panel, Paragraph
from agvbench.reporting.figures.style import ON_PAGE, dress, legend, new_panel, panel_title, to_svg
from agvbench.reporting.sections.base import Section
from agvbench.statistics.end_poses import in_order
from agvbench.types import Floats, Pose, Run
from agvbench.workflows.report import ReportData

_MOST_PER_PANEL = 60
_OVER_FLOOR = "All runs that count, where they were driven; those without a target calibrate, or drive freely."
_FROM_START = (
    "Runs with a target, moved to a common start (hollow); the arrow is the target and its heading. "
    f"At most {_MOST_PER_PANEL} runs per trajectory and condition are drawn."
)


class TrajectoriesSection(Section):
    """One drawing of the floor and a panel per trajectory."""

    slug, title, order = "trajectories", "Trajectories", 60

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the figures, or why there are none."""
        runs = [run for run in data.runs if run.is_ok]
        paths = {run.run_id: path for run in runs if len(path := drawn_path(run.frames)) > 1}
        runs = [run for run in runs if run.run_id in paths]
        if not runs:
            return [Paragraph("No run that counts has frames to draw.")]
        numbers = condition_numbers(in_order(run.condition for run in runs))
        named = legend(numbers)
        aimed, free = ([run for run in runs if run.target.is_finite is whether] for whether in (True, False))
        over = [
            Panel(title, draw_paths(_by_condition(group, paths, numbers), title, size_in=5.6))
            for title, group in (("Runs with a target", aimed), ("Runs without a target", free))
            if group
        ]
        floor = FigureBlock("floor", _OVER_FLOOR, over, named, wide=True)
        panels = list(_panels(aimed, paths, numbers))
        return [floor, FigureBlock("trajectories", _FROM_START, panels, named)] if panels else [floor]


def _panels(runs: Sequence[Run], paths: dict[str, Floats], numbers: dict[str, int]) -> Iterator[Panel]:
    for index, name in enumerate(dict.fromkeys(run.trajectory for run in runs)):
        chosen = [run for run in runs if run.trajectory == name]
        moved = {run.run_id: from_start(paths[run.run_id]) for run in chosen}
        svg = draw_paths(
            _by_condition(chosen, moved, numbers), f"trajectory-{index}", target=chosen[0].target, size_in=3.1
        )
        yield Panel(panel_title(name, chosen[0].target), svg)


def _by_condition(runs: Sequence[Run], paths: dict[str, Floats], numbers: dict[str, int]) -> dict[int, list[Floats]]:
    grouped: dict[int, list[Floats]] = {number: [] for number in numbers.values()}
    for run in runs:
        grouped[numbers[run.condition]].append(paths[run.run_id][:, 1:3])
    return {number: group[:_MOST_PER_PANEL] for number, group in grouped.items() if group}


_FLATTEST, _TALLEST = 0.45, 1.1


def draw_paths(paths: Mapping[int, Sequence[Floats]], name: str, *, target: Pose | None = None, size_in: float) -> str:
    """Return an SVG of paths, shape (n, 2) or more with x, y [m] first, by the number of their condition.

    With `target` the paths start at the origin, and the start and the target are marked with their headings.
    """
    low, high = _extent([path for group in paths.values() for path in group], target)
    width, height = high - low
    figure = new_panel(size_in, 0.6 + (size_in - 0.9) * height / width)
    axes = figure.add_subplot()
    dress(axes, x="x [m]", y="y [m]", size=10.0 if target else 9.0)
    for index, group in paths.items():
        draw_group(axes, group, index)
    if target is not None:
        draw_start_and_target(axes, target, ON_PAGE)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")
    axes.locator_params(nbins=6)
    return to_svg(figure, name)


def _extent(paths: Sequence[Floats], target: Pose | None) -> tuple[Floats, Floats]:
    """Return the corners of what is to be drawn: all paths and marks with a margin, neither too flat nor too tall."""
    marks = [] if target is None else [(0.0, 0.0), target[:2], tip(target)]
    points = np.concatenate([*(path[:, :2] for path in paths), np.reshape(marks, (-1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = high - low
    least = np.array([max(width, height / _TALLEST, 0.1), max(height, _FLATTEST * width, 0.1)])
    middle, half = (low + high) / 2.0, 0.54 * least
    return middle - half, middle + half
