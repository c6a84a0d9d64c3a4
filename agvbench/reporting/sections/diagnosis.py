"""What the vehicle model lacks: verdict, effects, errors before and after, and pictures of the residual."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.plot.residual_steps import AFTER, BEFORE, draw_steps
from agvbench.plot.style import colour, marker
from agvbench.reporting.content import (
    Block,
    Bullets,
    Column,
    FigureBlock,
    Panel,
    Paragraph,
    Table,
    Value,
    plain_sentences,
)
from agvbench.reporting.errors_by_recording import errors_by_recording
from agvbench.reporting.figures.style import MUTED, ON_PAGE, dress, new_figure, to_svg
from agvbench.reporting.next_steps import diagnose_command
from agvbench.reporting.sections.base import Section
from agvbench.types import Floats
from agvbench.workflows.diagnosis_files import (
    COLUMNS,
    DEFINITIONS,
    QUANTITIES,
    ShownDiagnosis,
    bounds_in_words,
    extrapolation_in_words,
    fit_in_words,
    items,
    left_in_words,
    logged_in_words,
    mapping,
    next_in_words,
    number,
    remedies_in_words,
    sessions_in_words,
    term_in_words,
)
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import pandas as pd

_FEATURES = {
    "speed": ("Residual along the way", "residual [%]", 100.0),
    "sideways": ("Residual to the left", "residual [%]", 100.0),
    "turning": ("Residual turn", "residual [°/m]", 180.0 / math.pi),
}
_AGAINST = {
    "time_in_run_s": "time in the run [s]",
    "speed_mps": "speed [m/s]",
    "curvature_per_m": "steering: curvature [1/m]",
    "direction": "direction (−1 backward, 1 forward)",
    "campaign_time_h": "time since the session began [h]",
}
_CAPTION = (
    "The residual of each step between two samples, per metre driven, in the vehicle's own frame: medians with "
    "quartiles of steps of all runs, with static maps (before) and with what was found (after). In the maps of the "
    "floor the area of a mark is the size of the median; discs are positive, squares negative; each pair has one scale."
)


class DiagnosisSection(Section):
    """The diagnosis that lies in the campaign directory."""

    slug, title, order = "diagnosis", "What the model lacks", 75

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return verdict, tables and pictures, or how to get them."""
        if data.diagnosis is None:
            return [Paragraph(f"No diagnosis lies here: {diagnose_command(data.path)} makes one.")]
        return diagnosis_blocks(data.diagnosis)


def diagnosis_blocks(shown: ShownDiagnosis) -> list[Block]:
    """Return what there is to say about a diagnosis; whatever its file lacks is left out."""
    content = shown.content
    if not content:
        return [
            Paragraph(" ".join(plain_sentences(problem) for problem in shown.problems) or "The diagnosis is empty.")
        ]
    blocks: list[Block] = [Paragraph(verdict_in_words(content), lead=True)]
    found = (_effects(content), _errors(content), *errors_by_recording(content), _states(content))
    blocks += [block for block in found if not isinstance(block, Table) or block.rows]
    said = (
        *left_in_words(content), *term_in_words(content), *fit_in_words(content), *extrapolation_in_words(content),
        *sessions_in_words(content), *logged_in_words(content), *remedies_in_words(content), *next_in_words(content),
        *shown.problems,
    )  # fmt: skip
    sentences = [plain_sentences(text) for text in said]
    if sentences:
        blocks.append(Bullets(sentences))
    if shown.residuals is None or shown.residuals.empty:
        blocks.append(Paragraph("The residuals were not kept, and are not drawn."))
    else:
        blocks += _pictures(shown.residuals)
    return blocks


def verdict_in_words(content: Mapping[str, Any]) -> str:
    """Return the verdict of a diagnosis and its reason."""
    why = mapping(content.get("provenance")).get("why", "")
    return plain_sentences(f"{content.get('verdict')}: {why}")


def _effects(content: Mapping[str, Any]) -> Table:
    rows: list[list[Value]] = []
    for effect in map(mapping, items(content.get("effects"))):
        others = ", ".join(map(str, items(effect.get("confounded_with"))))
        for name, estimate in mapping(effect.get("parameters")).items():
            e = mapping(estimate)
            value, stderr = (f"{number(e.get(key)):.4g}" for key in ("value", "stderr"))
            rows.append([str(effect.get("name")), str(name), f"{value} ± {stderr}", str(e.get("unit", "")), others])
    columns = ("effect", "parameter", "estimate", "unit", "or instead")
    return Table("effects", "Effects found.", [Column(c.replace(" ", "_"), c) for c in columns], rows)


def _states(content: Mapping[str, Any]) -> Table:
    rows: list[list[Value]] = []
    for name, value in mapping(content.get("states")).items():
        state = mapping(value)
        others = ", ".join(map(str, items(state.get("indistinguishable_from"))))
        reason = f"not distinguishable from {others}" if others else str(state.get("why", ""))
        if state.get("state") != "present":
            rows.append([str(name), str(state.get("state")).replace("_", " "), bounds_in_words(state) or reason])
    columns = [Column("effect", "effect"), Column("state", "state"), Column("bound", "95 % bound, or reason")]
    return Table("states", "Effects of the library that were not selected.", columns, rows)


def _errors(content: Mapping[str, Any]) -> Table:
    held = mapping(content.get("held_out"))
    rows: list[list[Value]] = []
    for name, title in QUANTITIES.items():
        errors = mapping(held.get(name))
        if errors:
            rows.append([title, *(number(errors.get(key)) for key in COLUMNS)])
    columns = [Column("quantity", "root mean square"), *(Column(key, title, 2) for key, title in COLUMNS.items())]
    runs = number(held.get("runs"))
    return Table("held_out", f"Prediction errors of {runs:.0f} test runs.", columns, rows, note=DEFINITIONS)


def _pictures(residuals: pd.DataFrame) -> list[Block]:
    blocks: list[Block] = []
    for feature, (title, label, unit) in _FEATURES.items():
        before, after = (unit * residuals[f"{when}_{feature}"].to_numpy() for when in ("before", "after"))
        panels = [
            Panel(
                f"{title}, against {words.partition(' [')[0].partition(' (')[0]}",
                _draw_dependence(residuals[name].to_numpy(), before, after, f"res-{feature}-{name}", x=words, y=label),
            )
            for name, words in _AGAINST.items()
        ]
        x, y = residuals["x_m"].to_numpy(), residuals["y_m"].to_numpy()
        most = float(np.quantile(np.abs(before), 0.9))
        unit_name = label.partition("[")[2].rstrip("]")
        for when, values in (("before", before), ("after", after)):
            label_floor = f"largest mark: {most:.2g} {unit_name}"
            drawn = draw_floor(x, y, values, f"res-{feature}-floor-{when}", most=most, label=label_floor)
            panels.append(Panel(f"{title}, by place on the floor, {when}", drawn))
        caption = _CAPTION if not blocks else title + ", as above."
        legend = [("before", BEFORE), ("after", AFTER)]
        blocks.append(FigureBlock(f"residual-{feature}", caption, panels, legend))
    return blocks


_CELLS, _FEWEST_IN_CELL = 14, 4


def _draw_dependence(covariate: Floats, before: Floats, after: Floats, name: str, *, x: str, y: str) -> str:
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
