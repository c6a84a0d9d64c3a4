"""Calibration curves: what was measured, the fitted map, and what it leaves."""

from __future__ import annotations

from agvbench.plot.calibration_curves import draw_measured
from agvbench.reporting.figures.style import INK, ON_PAGE, dress, new_figure, to_svg
from agvbench.workflows.calibration_curves import Curve


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
        residual = curve.value - curve.fitted
        draw_measured(below[0], curve.command, residual, curve.stderr, curve.left_out, ON_PAGE)
    draw_measured(top, curve.command, curve.value, curve.stderr, curve.left_out, ON_PAGE)
    return to_svg(figure, name)
