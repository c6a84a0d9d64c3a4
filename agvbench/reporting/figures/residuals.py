"""The residual against what it may depend on, before and after: medians with quartiles, and maps of the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agvbench.reporting.figures.style import INK, MUTED, PAPER, colour, dress, marker, new_figure, to_svg
from agvbench.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BEFORE, AFTER = 0, 1
_BINS, _FEWEST = 16, 8
_CELLS, _FEWEST_IN_CELL = 14, 4
_FEW_VALUES = 4


def draw_dependence(covariate: Floats, before: Floats, after: Floats, name: str, *, x: str, y: str) -> str:
    """Return an SVG of both residuals (n,) against a covariate (n,): medians and quartiles of bins."""
    figure = new_figure(3.3, 2.3)
    axes = figure.add_subplot()
    dress(axes, x=x, y=y, size=9.0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    bins = _bins(covariate)
    for index, values in ((BEFORE, before), (AFTER, after)):
        _quartiles(axes, covariate, values, bins, index)
    axes.margins(x=0.05)
    axes.locator_params(nbins=6)
    return to_svg(figure, name)


def _bins(covariate: Floats) -> Floats:
    """Return the edges of bins: one for each of few values, else of equal counts."""
    values = np.unique(np.round(covariate, 9))
    if len(values) <= _FEW_VALUES:
        middle = 0.5 * (values[1:] + values[:-1])
        return np.asarray(np.r_[-np.inf, middle, np.inf])
    edges = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, _BINS + 1)))
    edges[0], edges[-1] = -np.inf, np.inf
    return np.asarray(edges)


def _quartiles(axes: Axes, covariate: Floats, values: Floats, bins: Floats, index: int) -> None:
    which = np.digitize(covariate, bins) - 1
    rows = []
    for b in range(len(bins) - 1):
        own = which == b
        if np.count_nonzero(own) >= _FEWEST:
            rows.append((float(np.median(covariate[own])), *np.quantile(values[own], [0.25, 0.5, 0.75]).tolist()))
    if not rows:
        return
    at, low, middle, high = np.array(rows).T
    shown = colour(index)
    line = "-" if len(rows) > _FEW_VALUES else "none"
    axes.vlines(at, low, high, color=shown, linewidth=1.4, alpha=0.45)
    axes.plot(
        at, middle, linestyle=line, linewidth=1.0, marker=marker(index), markersize=4, color=shown,
        markeredgecolor=PAPER, markeredgewidth=0.5,
    )  # fmt: skip


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
