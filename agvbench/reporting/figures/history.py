"""Nightly values of a metric: a line per condition with the repeatability as a band, levels and steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from agvbench.plot.style import colour, literal, marker
from agvbench.reporting.content import plain
from agvbench.reporting.figures.style import MUTED, PAPER, dress, new_figure, to_svg
from agvbench.types import Floats
from agvbench.workflows.history.nights import ALL
from agvbench.workflows.history.result import History

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_MOST_MARKERS = 120
_DATES = 6
_BAND = 2.0
"""Standard errors to either side."""


def draw_history(history: History, metric: str, unit: str, numbers: Mapping[str, int]) -> str:
    """Return an SVG of one metric over the nights, conditions by their numbers.

    Nights are evenly spaced and labelled by date. A step is a vertical line between two nights, the 95 % interval of
    its night is shaded.
    """
    figure = new_figure(6.4, 2.7)
    axes = figure.add_subplot()
    dress(axes, x="", y=literal(plain(unit)), size=9.0)
    rows = history.nights
    rows = rows[(rows["metric"] == metric) & (rows["unit"] == unit) & (rows["trajectory"] == ALL)]
    steps = history.changes
    steps = steps[(steps["metric"] == metric) & (steps["unit"] == unit)]
    for condition, number in numbers.items():
        own = rows[rows["condition"] == condition]
        if len(own):
            _draw(axes, own, steps[steps["condition"] == condition], number)
    _label_dates(axes, history.campaigns)
    axes.set_ylim(bottom=0.0 if axes.get_ylim()[0] < 0.0 else None)
    return to_svg(figure, f"history-{metric}")


def _draw(axes: Axes, rows: pd.DataFrame, steps: pd.DataFrame, number: int) -> None:
    nights, values = (rows[name].to_numpy(dtype=float) for name in ("night", "value"))
    band = _BAND * rows["stderr"].fillna(0.0).to_numpy(dtype=float)
    shown = colour(number)
    axes.fill_between(nights, values - band, values + band, color=shown, alpha=0.15, linewidth=0.0)
    mark = marker(number) if len(nights) <= _MOST_MARKERS else None
    axes.plot(nights, values, color=shown, linewidth=0.8, marker=mark, markersize=3.5, markeredgecolor=PAPER)
    estimated = rows["lacking"].to_numpy() > 0
    axes.plot(nights[estimated], values[estimated], "o", color=shown, markersize=6.0, markerfacecolor="none")
    for night, earliest, latest in steps[["night", "earliest_night", "latest_night"]].to_numpy(dtype=float):
        axes.axvspan(earliest - 1.0, latest, color=shown, alpha=0.12, linewidth=0.0)
        axes.axvline(night - 0.5, color=shown, linewidth=1.2, linestyle="--")
    _draw_levels(axes, nights, steps, values)


def _draw_levels(axes: Axes, nights: Floats, steps: pd.DataFrame, values: Floats) -> None:
    starts = np.searchsorted(nights, sorted(steps["night"].to_numpy(dtype=float)))
    for part in np.split(np.arange(len(nights)), starts) if len(steps) else ():
        axes.plot(nights[part[[0, -1]]], [values[part].mean()] * 2, color=MUTED, linewidth=1.6)


def _label_dates(axes: Axes, campaigns: pd.DataFrame) -> None:
    count = len(campaigns)
    ticks: Sequence[int] = np.unique(np.linspace(0, count - 1, min(_DATES, count)).round().astype(int)).tolist()
    axes.set_xticks(ticks, [f"{campaigns['driven'].iloc[k]:%Y-%m-%d}" for k in ticks])
    axes.set_xlim(-0.5, count - 0.5)
