"""Where runs ended, seen from where they should have ended."""

from __future__ import annotations

from collections.abc import Mapping

from agvbench.plot.target_frame import draw_ends
from agvbench.reporting.figures.style import ON_PAGE, dress, new_figure, to_svg
from agvbench.types import Floats


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
    draw_ends(axes, ends, ON_PAGE)
    return to_svg(figure, name)
