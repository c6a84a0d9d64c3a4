"""Calibration curves: what was measured, the fitted map, and what it leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agvbench.reporting.figures.style import INK, MUTED, PAPER, colour, dress, new_figure, to_svg
from agvbench.workflows.calibration_curves import Curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MEASURED, _LEFT_OUT = 1, 0


def draw_curve(curve: Curve, name: str, *, command_label: str) -> str:
    """Return an SVG of one axle's curve over its residuals (only the points where there is no fitted map)."""
    fitted = len(curve.fitted) > 0
    figure = new_figure(3.3, 3.4 if fitted else 2.5)
    top, *below = figure.subplots(
        2 if fitted else 1, 1, sharex=True, squeeze=False, height_ratios=[3, 1.3][: 1 + fitted]
    )[:, 0]
    dress(top, x="" if fitted else command_label, y=f"measured [{curve.unit}]")
    if fitted:
        top.plot(curve.map_command, curve.map_value, color=INK, linewidth=1.2)
        dress(below[0], x=command_label, y=f"residual [{curve.unit}]")
        below[0].axhline(0.0, color=INK, linewidth=1.0)
        _points(below[0], curve, curve.value - curve.fitted)
    _points(top, curve, curve.value)
    return to_svg(figure, name)


def _points(axes: Axes, curve: Curve, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    for chosen, index, shape in ((~curve.left_out, _MEASURED, "o"), (curve.left_out, _LEFT_OUT, "x")):
        errors = np.where(np.isfinite(curve.stderr), curve.stderr, 0.0)[chosen]
        axes.errorbar(
            curve.command[chosen],
            values[chosen],
            yerr=errors,
            fmt=shape,
            markersize=4,
            color=colour(index),
            ecolor=MUTED,
            elinewidth=0.8,
            markeredgecolor=PAPER if shape == "o" else colour(index),
            markeredgewidth=0.5 if shape == "o" else 1.2,
        )
