"""The residual against what it may depend on, before and after: medians with quartiles, and maps of the floor."""

from __future__ import annotations

import numpy as np

from agvbench.plot.residual_steps import AFTER, BEFORE, draw_steps
from agvbench.reporting.figures.style import MUTED, ON_PAGE, colour, dress, marker, new_figure, to_svg
from agvbench.types import Floats

_CELLS, _FEWEST_IN_CELL = 14, 4


def draw_dependence(covariate: Floats, before: Floats, after: Floats, name: str, *, x: str, y: str) -> str:
    """Return an SVG of both residuals (n,) against a covariate (n,): medians and quartiles of bins."""
    figure = new_figure(3.3, 2.3)
    axes = figure.add_subplot()
    dress(axes, x=x, y=y, size=9.0)
    draw_steps(axes, covariate, before, after, ON_PAGE)
    return to_svg(figure, name)


def draw_floor(x_m: Floats, y_m: Floats, value: Floats, name: str, *, most: float, label: str) -> str:
    """Return an SVG of the median residual (n,) by place: discs whose area is its size, in one colour per sign.

    ``most`` is the size of the largest disc, the same in the pictures to be compared.
    """
    figure = new_figure(3.3, 3.1)
    axes = figure.add_subplot()
    dress(axes, x="x [m]", y="y [m]", size=9.0)
    axes.set_title(label, fontsize=9.0, color=MUTED)
    low, high = (np.array([f(x_m), f(y_m)]) for f in (np.min, np.max))
    side = max(float((high - low).max()), 0.1) / _CELLS
    column, row = (np.floor((v - a) / side).astype(int) for v, a in ((x_m, low[0]), (y_m, low[1])))
    cells = []
    for key in np.unique(column * 1000 + row):
        own = column * 1000 + row == key
        if np.count_nonzero(own) >= _FEWEST_IN_CELL:
            place = low + (np.array([key // 1000, key % 1000]) + 0.5) * side
            cells.append((*place.tolist(), float(np.median(value[own]))))
    if cells:
        px, py, size = np.array(cells).T
        area = 90.0 * np.minimum(np.abs(size) / max(most, 1e-12), 1.0)
        axes.scatter(px, py, s=1.0, color=MUTED, linewidths=0.0)
        for sign, index in ((1.0, BEFORE), (-1.0, AFTER)):
            own = sign * size > 0.0
            axes.scatter(px[own], py[own], s=area[own], color=colour(index + 2), marker=marker(index), linewidths=0.0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=6)
    return to_svg(figure, name)
