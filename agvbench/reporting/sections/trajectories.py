"""The ways that were driven: over the floor, and trajectory by trajectory from the start pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from agvbench.plot.drawn_path import drawn_path
from agvbench.plot.driven_paths import from_start
from agvbench.reporting.content import Block, FigureBlock, Panel, Paragraph
from agvbench.reporting.figures.floor import draw_paths
from agvbench.reporting.figures.labels import condition_numbers, legend, panel_title
from agvbench.reporting.sections.base import Section
from agvbench.statistics.end_poses import in_order
from agvbench.types import Floats, Run
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
        import pandas as pd

        runs = [run for run in data.runs if run.is_ok]
        paths = {run.run_id: path for run in runs if len(path := drawn_path(run.frames)) > 1}
        runs = [run for run in runs if run.run_id in paths]
        if not runs:
            return [Paragraph("No run that counts has frames to draw.")]
        numbers = condition_numbers(in_order(pd.Series([run.condition for run in runs])))
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
