"""Trajectories over the floor, and trajectory by trajectory from their start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from agvbench.plot.driven_paths import draw_group, draw_start_and_target, tip
from agvbench.reporting.figures.style import ON_PAGE, dress, new_figure, to_svg
from agvbench.types import Floats, Pose

_FLATTEST, _TALLEST = 0.45, 1.1


def draw_paths(paths: Mapping[int, Sequence[Floats]], name: str, *, target: Pose | None = None, size_in: float) -> str:
    """Return an SVG of paths, shape (n, 2) or more with x, y [m] first, by the number of their condition.

    With `target` the paths start at the origin, and the start and the target are marked with their headings.
    """
    low, high = _extent([path for group in paths.values() for path in group], target)
    width, height = high - low
    figure = new_figure(size_in, 0.55 + (size_in - 0.65) * height / width)
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
