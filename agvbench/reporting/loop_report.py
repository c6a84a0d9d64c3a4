"""The report of a loop: before and after first, then what was found, planned and driven."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from agvbench.errors import FileError
from agvbench.loop.before_after import (
    BeforeAfter,
    EndPosition,
    before_after,
    counts,
    end_positions,
    root_mean_square_bias,
)
from agvbench.loop.loop import Loop
from agvbench.reporting.console.tables import console_table
from agvbench.reporting.content import (
    Block,
    Bullets,
    Column,
    Content,
    FigureBlock,
    Links,
    Paragraph,
    Table,
    Value,
    plain,
    plain_sentences,
)
from agvbench.reporting.drawn_sections import drawn_sections
from agvbench.reporting.progress import track
from agvbench.reporting.sections.diagnosis import diagnosis_blocks
from agvbench.reporting.sections.headline import cloud_figure
from agvbench.reporting.write import HTML, TABLES, page_texts, subtitle_of, write_gathered, write_report
from agvbench.statistics.equivalence import Bias
from agvbench.statistics.quantities import COMPONENT_DEFINITIONS, COMPONENTS, DEFINITIONS
from agvbench.types import CONDITIONS
from agvbench.workflows.diagnosis_files import ShownDiagnosis, items, mapping, read_diagnosis
from agvbench.workflows.report import ReportData, gather

_NOTE = (
    f"{COMPONENT_DEFINITIONS} Bias: mean of the signed errors; sd: standard deviation of one repeat. The last column "
    "tests the corrected bias against ± 1 sd at the 5 % level: within, beyond, or too few repeats to say."
)
_LEARNED = ("along_mm", "across_mm", "heading_deg")
_PLANNED = {
    "along_mm": ("along mm", 1),
    "across_mm": ("across mm", 1),
    "delta_heading_deg": ("heading deg", 2),
    "delta_s_mm": ("Δs mm", 1),
}
_CAPTION = "Before and after: bias along, across and of heading"
_CAPTION_ENDS = "Before and after: median end position error [mm], and bias of Δs [mm]"


@dataclass(frozen=True)
class LoopReport:
    """What the report of a loop says, and the files that say it."""

    loop: Loop
    rows: Sequence[BeforeAfter]
    ends: Sequence[EndPosition]
    files: Sequence[Path]


def write_loop_report(loop: Loop) -> LoopReport:
    """Write ``report.html``, ``report.md`` and tables into the loop's directory, and the reports of both campaigns.

    Raises
    ------
    CampaignError
        If a campaign cannot be read.
    FileError
        If the directory cannot be written.
    """
    data = gather(loop.after, track=lambda runs, total: track(runs, total, what="reading runs"))
    rows, ends = before_after(data.errors), end_positions(data.errors)
    own = _sections(loop, rows, ends, data)
    sections = [*own, *map(_without_clouds, drawn_sections(data, but={section.slug for section in own}))]
    title = f"Loop {plain(loop.directory.name)}"
    texts = dict(page_texts(title, subtitle_of(data), sections, loop.directory))
    write_report(loop.before, recording=False)
    write_gathered(data)
    try:
        (loop.directory / TABLES).mkdir(exist_ok=True)
        for name, text in texts.items():
            (loop.directory / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError("cannot be written", where=loop.directory, value=error.strerror) from None
    return LoopReport(loop, rows, ends, [loop.directory / name for name in texts])


def print_loop(console: Console, report: LoopReport) -> None:
    """Print before and after, and where the report is."""
    console.print(console_table(_narrow(before_after_table(report.rows), report.rows)))
    console.print(console_table(_narrow_ends(report.ends)))
    for sentence in _headline(report.loop, report.rows, report.ends):
        console.print(Text(sentence))
    console.print(Text(f"{DEFINITIONS} {COMPONENT_DEFINITIONS}", style="dim"))
    console.print(Text(f"report: {report.files[0]}"), soft_wrap=True)


def before_after_table(rows: Sequence[BeforeAfter]) -> Table:
    """Return the table of biases under each condition, and whether the corrected one is within repeatability."""
    shown = _conditions(row.by_condition for row in rows)
    columns = [Column("trajectory", "trajectory"), Column("error", "error")]
    for condition in shown:
        columns.append(Column(f"{condition}_bias", "bias", 2, group=condition))
        columns.append(Column(f"{condition}_sd", "sd", 2, group=condition))
    columns += [Column("repeats", "n", 0), Column("verdict", "corrected bias ± 1 sd")]
    return Table("before_after", _CAPTION, columns, [_row(row, shown) for row in rows], note=_NOTE)


def end_position_table(ends: Sequence[EndPosition]) -> Table:
    """Return the table of end position errors and Δs, a row per trajectory."""
    shown = _conditions(end.median_mm for end in ends)
    columns = [Column("trajectory", "trajectory")]
    for c in shown:
        columns.append(Column(f"{c}_position_mm", "end position", 1, group=c))
        columns += [Column(f"{c}_delta_s_bias", "Δs", 1, group=c), Column(f"{c}_delta_s_sd", "sd", 1, group=c)]
    rows: list[list[Value]] = []
    for end in ends:
        cells = [(end.median_mm.get(c), end.delta_s.get(c)) for c in shown]
        numbers = [(position, s.bias if s else None, s.sd if s else None) for position, s in cells]
        rows.append([end.trajectory, *(number for three in numbers for number in three)])
    return Table("end_position", _CAPTION_ENDS, columns, rows, note=DEFINITIONS)


def _narrow_ends(ends: Sequence[EndPosition]) -> Table:
    """Return the table of end positions for a console: one column per condition, without standard deviations."""
    shown = _conditions(end.median_mm for end in ends)
    columns = [Column("trajectory", "trajectory"), Column("error", "error"), *(Column(c, c, 1) for c in shown)]
    rows: list[list[Value]] = []
    for end in ends:
        biases = {condition: found.bias for condition, found in end.delta_s.items()}
        for error, values in (("end position error mm", end.median_mm), ("Δs mm", biases)):
            rows.append([end.trajectory, error, *(values.get(c) for c in shown)])
    return Table("end_position", _CAPTION_ENDS, columns, rows)


def _row(row: BeforeAfter, shown: Sequence[str]) -> list[Value]:
    cells = [row.by_condition.get(condition) for condition in shown]
    numbers: list[Value] = [n for cell in cells for n in ((cell.bias, cell.sd) if cell else (None, None))]
    left = row.corrected
    ends: list[Value] = ["", ""] if left is None else [left.repeats, str(left.verdict)]
    return [row.trajectory, f"{row.quantity.symbol} {row.quantity.unit}", *numbers, *ends]


def _conditions(driven: Iterable[Mapping[str, object]]) -> list[str]:
    known = {condition for by_condition in driven for condition in by_condition}
    return [c for c in CONDITIONS if c in known]


def _narrow(table: Table, rows: Sequence[BeforeAfter]) -> Table:
    """Return the table for a console: one column per condition."""
    conditions = _conditions(row.by_condition for row in rows)
    columns = [*table.columns[:2], *(Column(c, c, 2) for c in conditions), Column("sd", "± sd", 2), *table.columns[-2:]]
    shown = []
    for row, cells in zip(rows, table.rows, strict=True):
        biases = cells[2 : 2 + 2 * len(conditions) : 2]
        shown.append([*cells[:2], *biases, row.corrected.sd if row.corrected else None, *cells[-2:]])
    return Table(table.slug, table.caption, columns, shown)


def _sections(loop: Loop, rows: Sequence[BeforeAfter], ends: Sequence[EndPosition], data: ReportData) -> list[Content]:
    said = list(_said(loop.plans))
    blocks: list[Block] = [Paragraph(sentence, lead=True) for sentence in _headline(loop, rows, ends)]
    blocks += cloud_figure(data, slug="before-after-ends", small=False)
    reports = {"the campaign that was diagnosed": loop.before, "the campaign that compares the conditions": loop.after}
    links = Links([(f"Report of {words}: {path.name}", path / "report" / HTML) for words, path in reports.items()])
    tables = [end_position_table(ends), before_after_table(rows)]
    return [
        Content("before-after", "Before and after", [*blocks, links, *tables]),
        Content("diagnosis", "What the calibrated model lacks", _diagnosis(loop)),
        Content("plans", "What corrected plans compensate", [_plans(loop.plans), *([Bullets(said)] if said else [])]),
    ]


def _without_clouds(content: Content) -> Content:
    """Return a section without the figure that stands at the top of this page already."""
    blocks = [b for b in content.blocks if not (isinstance(b, FigureBlock) and b.slug == "clouds")]
    return replace(content, blocks=blocks)


def _means(rows: Sequence[BeforeAfter], ends: Sequence[EndPosition]) -> Iterator[str]:
    """Yield the means of error and biases over the trajectories that were driven under every condition."""
    driven = [c for c in CONDITIONS if any(c in end.median_mm for end in ends)]
    # A mean over other trajectories is no gain: those that lack a condition are left out of all.
    shared = [end for end in ends if all(c in end.median_mm for c in driven)]
    if shared:
        positions = [f"{c} {statistics.fmean(end.median_mm[c] for end in shared):.1f} mm" for c in driven]
        yield f"Median end position error, mean over trajectories: {', '.join(positions)}."
    if lacking := sorted({end.trajectory for end in ends} - {end.trajectory for end in shared}):
        yield f"Not driven under every condition, and in none of these means: {', '.join(lacking)}."
    everywhere = {end.trajectory for end in shared}
    compared = [row for row in rows if row.trajectory in everywhere]
    for quantity in COMPONENTS if shared else ():
        biases = {c: root_mean_square_bias(compared, quantity, c) for c in driven}
        known = [f"{c} {b:.{quantity.digits}f} {quantity.unit}" for c, b in biases.items() if b == b]  # noqa: PLR0124
        yield f"Bias of {quantity.symbol}, root mean square over trajectories: {', '.join(known)}."


def _headline(loop: Loop, rows: Sequence[BeforeAfter], ends: Sequence[EndPosition]) -> Iterator[str]:
    yield from _means(rows, ends)
    found = counts(list(rows))
    total = sum(found.values())
    yield (
        f"Of {total} corrected biases (along, across, heading) {found[Bias.WITHIN]} are within ± 1 standard deviation "
        f"of a repeat, {found[Bias.BEYOND]} beyond; of {found[Bias.INCONCLUSIVE]} the repeats cannot say."
    )
    moved = [entry["remainder"] for entry in loop.plans.values() if any(entry.get("remainder", {}).values())]
    if moved:
        farthest = max(math.hypot(left["along_mm"], left["across_mm"]) for left in moved)
        turned = max(abs(left["heading_deg"]) for left in moved)
        yield (
            f"Not all of it is the model's merit: on {len(moved)} trajectories the goal was moved, by up to "
            f"{farthest:.1f} mm and {turned:.2f} deg, by the bias that the model had there before "
            "(--model-only leaves that out)."
        )
    verdict = str(loop.diagnosis.get("verdict"))
    if verdict not in {"NAMED", "ADEQUATE"}:
        yield f"The diagnosis was {plain(verdict)}: what it did not name is not corrected but where it showed before."


def _diagnosis(loop: Loop) -> list[Block]:
    shown = read_diagnosis(loop.directory) or ShownDiagnosis(loop.diagnosis)
    blocks = diagnosis_blocks(shown)
    if items(mapping(shown.content.get("unexplained")).get("depends_on")):
        blocks.insert(1, Paragraph("What is left unexplained is corrected only where its bias was measured before."))
    return blocks


def _plans(plans: Mapping[str, Any]) -> Table:
    groups = {"uncorrected": "by the model, uncorrected", "remaining": "by the model, corrected"}
    columns = [Column("trajectory", "trajectory")]
    for key, group in groups.items():
        columns += [Column(f"{key}_{field}", title, digits, group=group) for field, (title, digits) in _PLANNED.items()]
    columns += [Column(f"learned_{field}", field.replace("_", " "), 2, group="bias before") for field in _LEARNED]
    rows: list[list[Value]] = [
        [name, *(entry[key][field] for key in groups for field in _PLANNED), *(entry["remainder"][f] for f in _LEARNED)]
        for name, entry in plans.items()
        if "remaining" in entry
    ]
    return Table(
        "plans",
        "Where the vehicle should end, driven by the corrected model's static maps alone and by corrected plans.",
        columns,
        rows,
        note="Bias before: that of the corrected model when it was tried, subtracted from the goal.",
    )


def _said(plans: Mapping[str, Any]) -> Iterator[str]:
    for name, entry in plans.items():
        for sentence in [entry["problem"]] if "problem" in entry else entry.get("said", []):
            yield f"{plain(name)}: {plain_sentences(sentence)}"
