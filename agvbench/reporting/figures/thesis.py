"""The thesis' residuals as figures: held-out errors before and after, one SVG file per table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agvbench.errors import FileError
from agvbench.plot.style import CONDITION_COLOURS, MARKERS
from agvbench.reporting.figures.style import new_figure
from agvbench.thesis.residuals import Traced, traced

_INK, _GRID, _PAPER = "#222222", "#dddddd", "#ffffff"


def write_thesis_figures(directory: str | Path) -> list[Path]:
    """Write one SVG per residual into `directory`; return the paths.

    Raises
    ------
    FileError
        If they cannot be written.
    """
    directory = Path(directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return [_write(item, directory / f"thesis-{item.name.replace('_', '-')}.svg") for item in traced()]
    except OSError as error:
        raise FileError("cannot be written", where=directory, value=error.strerror, remedy="see --figures") from None


def _write(item: Traced, path: Path) -> Path:
    import matplotlib as mpl

    figure = new_figure(6.0, 2.6)
    figure.set_facecolor(_PAPER)
    axes = figure.add_subplot()
    axes.axhline(0.0, color=_INK, linewidth=0.8)
    # Before a little to the left, after to the right, where both have the same place.
    shift = 0.004 * float(np.ptp(item.at))
    for side, residual, words in ((-1, item.residual_before, item.before), (1, item.residual_after, item.after)):
        index = (side + 1) // 2
        root = item.rms_after if index else item.rms_before
        label = f"{words}: rms {root:.3g} {item.unit}"
        axes.plot(
            item.at + side * shift, residual, linestyle="none", marker=MARKERS[index], markersize=3.5,
            color=CONDITION_COLOURS[index], alpha=0.8, markeredgewidth=0.0, label=label,
        )  # fmt: skip
    axes.set_xlabel(item.axis, color=_INK, fontsize=9)
    axes.set_ylabel(f"measured − predicted [{item.unit}]", color=_INK, fontsize=9)
    axes.set_title(f"{item.source}: {item.effect}", fontsize=9.5, color=_INK, loc="left")
    axes.tick_params(labelsize=8, colors=_INK)
    axes.grid(color=_GRID, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False, loc="best")
    with mpl.rc_context({"svg.hashsalt": item.name, "svg.fonttype": "none"}):
        figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})
    return path
