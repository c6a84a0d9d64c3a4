"""Calibration curves with their residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.plot.calibration_curves import draw_measured
from agvbench.reporting.content import Block, Column, FigureBlock, Panel, Paragraph, Table, Value
from agvbench.reporting.figures.style import INK, ON_PAGE, dress, new_figure, to_svg
from agvbench.reporting.sections.base import Section
from agvbench.types import CommandUnit
from agvbench.vehicle.channels import Channels
from agvbench.workflows.calibration import Curve
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("axle", "channel"),
    Column("map", "map"),
    Column("points", "points", 0),
    Column("left_out", "left out", 0),
    Column("unit", "unit"),
    Column("residual_sd", "residual sd", 4),
    Column("largest_residual", "largest", 4),
)
_CAPTION = (
    "Measured points with their standard errors and the fitted map; below, what the map leaves. "
    "Crosses were left out of the fit."
)


class CalibrationSection(Section):
    """A panel and a row per channel."""

    slug, title, order = "calibration", "Calibration", 80

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return figure and table, or why there are none."""
        curves, absent = data.curves.curves, data.curves.why_absent
        blocks: list[Block] = [Paragraph(absent)] if absent else []
        if not curves:
            return blocks or [Paragraph("The campaign holds no calibration measurements.")]
        channels = data.header.channels
        panels = [
            Panel(c.channel, draw_curve(c, f"curve-{c.axle}", command_label=f"command [{_command_unit(c, channels)}]"))
            for c in curves
        ]
        blocks.append(FigureBlock("calibration-curves", _CAPTION, panels))
        rows = [_row(curve, data.curves.kinds.get(curve.axle, "")) for curve in curves]
        blocks.append(
            Table("calibration_fits", "How well the maps fit the points they were fitted to.", _COLUMNS, rows)
        )
        return blocks


def _command_unit(curve: Curve, channels: Channels) -> str:
    unit: CommandUnit = getattr(channels, curve.axle).unit
    if unit == "si":  # a command is what it sets
        return "rad" if curve.unit == "deg" else curve.unit
    return "µs" if unit == "us" else "–"


def _row(curve: Curve, kind: str) -> list[Value]:
    kept = ~curve.left_out
    residuals = (curve.value - curve.fitted)[kept] if len(curve.fitted) else np.empty(0)
    return [
        curve.channel,
        kind,
        len(curve.value),
        int(curve.left_out.sum()),
        curve.unit,
        float(np.std(residuals)) if len(residuals) else None,
        float(np.abs(residuals).max()) if len(residuals) else None,
    ]


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
