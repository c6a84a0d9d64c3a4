"""Where runs ended, seen from where they should have ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from agvbench.reporting.figures.style import INK, MUTED, PAPER, colour, dress, marker, new_figure, to_svg
from agvbench.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_end_poses(ends: Mapping[int, Floats], name: str) -> str:
    """Return an SVG of end poses in the target frame.

    Parameters
    ----------
    ends
        By the number of the condition: shape (n, 3), mm ahead of the target, mm to its left, heading error [rad].
        The short line of each point is its heading; along the horizontal axis it would be right.
    name
        Names the drawing.
    """
    figure = new_figure(3.1, 2.9)
    axes = figure.add_subplot()
    dress(axes, x="ahead of target [mm]", y="left of target [mm]")
    axes.axhline(0.0, color=MUTED, linewidth=0.7)
    axes.axvline(0.0, color=MUTED, linewidth=0.7)
    half = _half_width(ends)
    for index, points in ends.items():
        _points(axes, points, index, tick=0.09 * half)
        middle = np.median(points[:, :2], axis=0)
        axes.plot(
            *middle, marker=marker(index), markersize=9, color=colour(index), markeredgecolor=INK, markeredgewidth=1.0
        )
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal", adjustable="box")
    return to_svg(figure, name)


def _points(axes: Axes, points: Floats, index: int, *, tick: float) -> None:
    tips = points[:, :2] + tick * np.column_stack([np.cos(points[:, 2]), np.sin(points[:, 2])])
    gap = np.full((len(points), 1), np.nan)
    x, y = (np.column_stack([points[:, axis], tips[:, axis], gap]).ravel() for axis in (0, 1))
    axes.plot(x, y, color=colour(index), linewidth=0.9)
    axes.plot(
        points[:, 0],
        points[:, 1],
        linestyle="none",
        marker=marker(index),
        markersize=4,
        color=colour(index),
        markeredgecolor=PAPER,
        markeredgewidth=0.5,
    )


def _half_width(ends: Mapping[int, Floats]) -> float:
    """Return half the width [mm] of a square about the target in which every point lies, at least 5 mm."""
    farthest = max((float(np.abs(points[:, :2]).max()) for points in ends.values()), default=0.0)
    return 1.15 * max(5.0, farthest)
