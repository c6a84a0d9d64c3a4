"""Trajectories over the floor, and trajectory by trajectory from their start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from agvbench.reporting.figures.style import INK, MUTED, PAPER, colour, dress, new_figure, to_svg
from agvbench.types import Floats, Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ARROW_M = 0.22


def draw_paths(paths: Mapping[int, Sequence[Floats]], name: str, *, target: Pose | None = None, size_in: float) -> str:
    """Return an SVG of paths, shape (n, 2) or more with x, y [m] first, by the number of their condition.

    With `target` the paths start at the origin, and the start and the target are marked with their headings.
    """
    figure = new_figure(size_in, size_in * 0.85)
    axes = figure.add_subplot()
    dress(axes, x="x [m]", y="y [m]")
    for index, group in paths.items():
        line = _joined(group)
        axes.plot(line[:, 0], line[:, 1], color=colour(index), linewidth=0.9, alpha=0.75, solid_capstyle="round")
    if target is not None:
        _mark(axes, Pose(0.0, 0.0, 0.0), filled=False)
        _mark(axes, target, filled=True)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    return to_svg(figure, name)


def _joined(group: Sequence[Floats]) -> Floats:
    """Return many paths as one line with gaps, which is drawn many times faster."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([piece for path in group for piece in (path[:, :2], gap)] or [gap])


def _mark(axes: Axes, pose: Pose, *, filled: bool) -> None:
    tip = pose.x_m + _ARROW_M * np.cos(pose.heading_rad), pose.y_m + _ARROW_M * np.sin(pose.heading_rad)
    ink = INK if filled else MUTED
    axes.annotate("", tip, pose[:2], arrowprops={"arrowstyle": "->", "color": ink, "linewidth": 1.1, "shrinkA": 0})
    axes.plot(*pose[:2], marker="o", markersize=5, color=ink, markerfacecolor=ink if filled else PAPER, zorder=5)
