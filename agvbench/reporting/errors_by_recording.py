"""The position errors of free driving by recording: a table, and a picture of every predictor with its interval."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agvbench.plot.style import colour, marker
from agvbench.reporting.content import Block, Column, FigureBlock, Panel, Table, Value, plain
from agvbench.reporting.figures.style import MUTED, dress, new_figure, to_svg
from agvbench.workflows.diagnosis_files import items, mapping, number

PREDICTORS = {
    "static": "static maps",
    "speed_held": "speed held",
    "naive": "constant velocity",
    "believed": "nominal",
    "population": "as fitted",
    "after": "after",
}
"""Titles of the predictors, by their names in the diagnosis' JSON."""

PARTS = "within, beyond: (number of) windows with commands within and beyond the range of the training windows"
"""What the parts of a recording are."""

_COLOURS = {"static": 0, "speed_held": 2, "naive": 3, "believed": 4, "population": 5, "after": 1}
_MOST_RECORDINGS, _MOST_DRAWN = 24, 16
_CAPTION = (
    "Root mean square of the position error {ahead} ahead in the test windows, with 95 % intervals over sections of "
    "the recording. A vertical line marks the error due to noise. As fitted, the model has one steering and one drive "
    "for all recordings; after is with those estimated from earlier windows of each recording."
)


@dataclass(frozen=True)
class RecordingErrors:
    """The errors in the windows of a recording, or in those of its ``part`` within or beyond the training commands.

    ``ahead``: prediction time with its unit. ``content``: the errors, as in the diagnosis' JSON.
    """

    recording: str
    part: str
    is_test: bool
    windows: float
    ahead: str
    content: Mapping[str, Any]

    @property
    def title(self) -> str:
        """The recording, or its part with the number of windows."""
        if self.part:
            return f"  {self.part} ({self.windows:.0f})"
        return f"{self.recording} (test)" if self.is_test else self.recording

    @property
    def floor_mm(self) -> float:
        """The error due to noise [mm]."""
        return number(self.content.get("floor_mm"))

    def has(self, predictor: str) -> bool:
        """Return whether the predictor has an error."""
        return f"{predictor}_mm" in self.content

    def error_mm(self, predictor: str) -> tuple[float, float, float]:
        """Return the root mean square [mm] of a predictor and its 95 % interval; NaN where there is none."""
        error = mapping(self.content.get(f"{predictor}_mm"))
        return number(error.get("rms")), number(error.get("low")), number(error.get("high"))


def recorded_errors(content: Mapping[str, Any]) -> list[RecordingErrors]:
    """Return the errors by recording, part and prediction time, the test recordings first; at most 24 recordings."""
    windows = mapping(mapping(content.get("provenance")).get("windows"))
    rows = sorted(map(mapping, items(windows.get("recordings"))), key=lambda row: not row.get("held_out"))
    found = []
    for row in rows[:_MOST_RECORDINGS]:
        for part in ("", "within", "beyond"):
            own = mapping(row.get(part)) if part else row
            where = str(row.get("recording")), part, bool(row.get("held_out")), number(own.get("windows"))
            found += [
                RecordingErrors(*where, str(key).removeprefix("ahead_").replace("_", " "), mapping(value))
                for key, value in own.items()
                if str(key).startswith("ahead_")
            ]
    return found


def known_predictors(rows: Sequence[RecordingErrors]) -> list[str]:
    """Return the names of the predictors that have errors."""
    return [name for name in PREDICTORS if any(row.has(name) for row in rows)]


def errors_by_recording(content: Mapping[str, Any]) -> list[Block]:
    """Return the table and the picture of a diagnosis of free driving; nothing for runs from rest."""
    rows = recorded_errors(content)
    if not rows:
        return []
    horizon = rows[-1].ahead
    tested = [row for row in rows if row.is_test and row.ahead == horizon][:_MOST_DRAWN]
    blocks: list[Block] = []
    if any(math.isfinite(row.error_mm(name)[0]) for row in tested for name in PREDICTORS):
        legend = [(PREDICTORS[name], _COLOURS[name]) for name in known_predictors(tested)]
        panel = Panel(f"Position error {horizon} ahead", _drawn(tested))
        caption = _CAPTION.format(ahead=horizon)
        blocks.append(FigureBlock("errors-by-recording", caption, [panel], legend, wide=True))
    return [*blocks, _table(rows)]


def _table(rows: Sequence[RecordingErrors]) -> Table:
    known = known_predictors(rows)
    columns = [
        Column("recording", "recording"),
        Column("part", "part"),
        Column("windows", "windows", 0),
        Column("ahead", "ahead"),
        Column("floor_mm", "due to noise", 0),
        *(Column(f"{name}_mm", PREDICTORS[name], 0) for name in known),
    ]
    table: list[list[Value]] = []
    for row in rows:
        kind = "test" if row.is_test else "training"
        errors = [row.error_mm(name)[0] for name in known]
        table.append([plain(row.recording), row.part or kind, row.windows, row.ahead, row.floor_mm, *errors])
    caption = "Position error by recording, root mean square [mm]."
    return Table("by_recording", caption, columns, table, grouped=True, note=PARTS + ".")


def _drawn(rows: Sequence[RecordingErrors]) -> str:
    """Return the picture of the errors of `rows`, one below the other."""
    figure = new_figure(7.2, 0.7 + 0.34 * len(rows))
    axes = figure.add_subplot()
    dress(axes, x="position error [mm]", y="", size=9.0)
    known = known_predictors(rows)
    for k, row in enumerate(rows):
        axes.plot(row.floor_mm, k, "|", color=MUTED, markersize=9.0)
        for shift, name in zip(np.linspace(-0.25, 0.25, len(known)), known, strict=True):
            rms, low, high = row.error_mm(name)
            index = _COLOURS[name]
            axes.plot([low, high], [k + shift] * 2, color=colour(index), linewidth=1.2)
            axes.plot(rms, k + shift, marker(index), color=colour(index), markersize=4.5)
    axes.set_xscale("log")
    axes.set_ylim(len(rows) - 0.5, -0.5)
    labels = [plain(row.title if row.part else f"{row.recording} ({row.windows:.0f})") for row in rows]
    axes.set_yticks(range(len(rows)), labels, parse_math=False)
    return to_svg(figure, "errors-by-recording")
