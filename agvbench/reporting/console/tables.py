"""Tables on the console: reports and comparisons in short, as wide as the terminal allows."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from agvbench.reporting.content import Column, Paragraph, Table, Value, plain, plain_sentences
from agvbench.reporting.gate_files import gate_sentence, gate_table
from agvbench.statistics.comparison_summary import headline, notes_in_words
from agvbench.statistics.differences import ALL
from agvbench.statistics.quantities import COMPONENT_DEFINITIONS, DEFINITIONS
from agvbench.statistics.repeats.sample_size import plan_in_words

if TYPE_CHECKING:
    from agvbench.metrics.gate import GateCheck
    from agvbench.reporting.write import WrittenReport
    from agvbench.statistics import Comparison, Difference
    from agvbench.statistics.intervals import Interval
    from agvbench.statistics.repeats.sample_size import PlannedRepeats
    from agvbench.workflows.report import ReportData

_VERDICT_STYLES = {
    "better": "green",
    "worse": "bold red",
    "same": "cyan",
    "cannot": "dim",
    "pass": "green",
    "fail": "bold red",
    "inconclusive": "dim",
}
_LONGEST_HEADING, _NARROWEST = 14, 110
_INTERVAL = "95 % interval"
_UNLIMITED = 1000
_SHORT = {"same within margin": "same", "(same within margin)": "(same)"}


def console_table(table: Table) -> RenderableType:
    """Return `table` for rich; names are shown as they are, never read as markup or control codes."""
    shown = RichTable(title=Text(plain(table.caption)), box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
    shown.collapse_padding = True
    for column in table.columns:
        heading = f"{column.group}\n{column.title}" if column.group else column.title
        number, whole = column.digits is not None, column.title == _INTERVAL
        justify: Literal["left", "right"] = "right" if number else "left"
        shown.add_column(Text(plain(heading)), justify=justify, overflow="fold", no_wrap=number or whole)
    for row in table.shown_rows():
        shown.add_row(*(_styled(cell, column) for cell, column in zip(row, table.columns, strict=True)))
    return shown


def wide_console() -> Console:
    """Return standard output, at least 110 columns wide where neither a terminal nor ``COLUMNS`` says otherwise."""
    console = Console()
    is_said = console.is_terminal or os.environ.get("COLUMNS", "").isdigit()
    return console if is_said else Console(width=max(_NARROWEST, console.width))


class _Fitting:
    """The first of several layouts that is no wider than the console; the last where all are."""

    def __init__(self, *layouts: RenderableType) -> None:
        self._layouts = layouts

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[RenderableType]:
        unlimited = options.update(max_width=_UNLIMITED)
        widths = (Measurement.get(console, unlimited, layout).maximum for layout in self._layouts)
        fitting = (layout for layout, width in zip(self._layouts, widths, strict=True) if width <= options.max_width)
        yield next(fitting, self._layouts[-1])


def comparison_summary(comparison: Comparison) -> RenderableType:
    """Return a comparison as a table that fits a console: medians, difference with its interval, verdict.

    Where the console is narrow, names of trajectories get lines of their own; where it is narrower still, intervals
    are left out.
    """
    heading_a, heading_b = _headings(comparison)
    columns = [
        Column("trajectory", "trajectory"),
        Column("quantity", "error"),
        Column("repeats", "n"),
        Column("median_a", heading_a, 2),
        Column("median_b", heading_b, 2),
        Column("difference", "change", 2),
        Column("interval", _INTERVAL),
        Column("verdict", "verdict"),
    ]
    several = comparison.has_several_conditions
    rows = [_console_row(d, columns[5], several=several) for d in comparison.worst_first]
    caption = f"{heading_b} against {heading_a} (medians; smaller is better; worst first)"
    wide, grouped = (Table("comparison", caption, columns, made) for made in (_named_once(rows), rows))
    return _Fitting(console_table(wide), _grouped(grouped), _grouped(_without(grouped, "interval")))


def _named_once(rows: Sequence[Sequence[Value]]) -> list[list[Value]]:
    """Return rows with their first cell left out where the row before has the same."""
    before = [None, *(row[0] for row in rows)]
    return [["" if row[0] == last else row[0], *row[1:]] for row, last in zip(rows, before, strict=False)]


def _without(table: Table, name: str) -> Table:
    kept = [k for k, column in enumerate(table.columns) if column.name != name]
    return replace(table, columns=[table.columns[k] for k in kept], rows=[[row[k] for k in kept] for row in table.rows])


def _grouped(table: Table) -> RenderableType:
    """Return `table` with its first column's names on lines of their own, above the rows that they name."""
    columns, rows = table.columns[1:], []
    for (name, *row), named in zip(table.rows, _named_once(table.rows), strict=True):
        if named[0]:
            rows.append([name, *[None] * (len(columns) - 1)])
        rows.append([f"· {row[0]}", *row[1:]])
    return console_table(replace(table, columns=columns, rows=rows))


def shift_summary(comparison: Comparison) -> RenderableType:
    """Return how the mean end positions moved as a table that fits a console, the largest shift first."""
    heading_a, heading_b = _headings(comparison)
    columns = [Column("trajectory", "trajectory")]
    for name in ("along", "across"):
        columns += [Column(name, f"{name} mm", 1), Column(f"{name}_interval", _INTERVAL)]
    several, rows = comparison.has_several_conditions, []
    for shift in comparison.shifts:
        cells: list[Value] = [f"{shift.trajectory} {shift.condition}" if several else shift.trajectory]
        for part in (shift.along, shift.across):
            cells += [part.estimate, _interval(part, columns[1])]
        rows.append(cells)
    caption = f"Mean end position, {heading_b} minus {heading_a} (largest first; no verdict)"
    table = Table("end_shift", caption, columns, rows)
    return _Fitting(console_table(table), console_table(_without(_without(table, "along_interval"), "across_interval")))


def _headings(comparison: Comparison) -> tuple[str, str]:
    names = plain(comparison.name_a), plain(comparison.name_b)
    return names if max(map(len, names)) <= _LONGEST_HEADING else ("A", "B")


def _console_row(d: Difference, difference: Column, *, several: bool) -> list[Value]:
    name = f"{d.trajectory} {d.condition}" if several and d.trajectory != ALL else d.trajectory
    medians = d.a.median, d.b.median, d.interval.estimate
    a, b = d.a.repeats, d.b.repeats
    repeats = str(a) if a == b else f"{a}, {b}"
    verdict = _SHORT.get(d.shown_verdict, d.shown_verdict)
    return [name, d.quantity.labelled, repeats, *medians, _interval(d.interval, difference), verdict]


def _interval(interval: Interval, column: Column) -> str:
    low, high = column.shown(interval.low), column.shown(interval.high)
    return f"{low} … {high}" if low else ""


def end_pose_summary(data: ReportData) -> RenderableType:
    """Return medians and quartiles per trajectory and condition, beside the thesis' medians where its vehicle drove."""
    columns = [
        Column("trajectory", "trajectory"),
        Column("reading", "error"),
        Column("condition", "condition"),
        Column("repeats", "n", 0),
        Column("q1", "Q1", 2),
        Column("median", "MED", 2),
        Column("q3", "Q3", 2),
    ]
    if data.end_poses["published_median"].notna().any():
        columns.append(Column("published_median", "MED", 2, group="thesis"))
    rows = [[row[c.name] for c in columns] for row in data.end_poses.to_dict("records")]
    return console_table(Table("end_poses", "End poses [mm, deg]", columns, rows))


def said_first(report: WrittenReport) -> list[Text]:
    """Return the paragraphs of a report's first section."""
    blocks = [block for block in report.sections[0].blocks if isinstance(block, Paragraph)]
    return [Text(block.text, style="" if block.lead else "dim") for block in blocks]


def print_report(console: Console, report: WrittenReport) -> None:
    """Print what a report says in short, and where it is."""
    for comparison in report.data.comparisons:
        console.print(comparison_summary(comparison))
    if not report.data.comparisons and len(report.data.end_poses):
        console.print(end_pose_summary(report.data))
    for text in said_first(report):
        console.print(text)
    console.print(Text(f"wrote {report.files[0]} and {len(report.files) - 1} more files"), soft_wrap=True)


def print_warnings(console: Console, sentences: Sequence[str]) -> None:
    """Print what to know before a comparison."""
    for sentence in sentences:
        console.print(Text(plain_sentences(sentence), style="yellow"), soft_wrap=not console.is_terminal)


def print_comparison(console: Console, comparison: Comparison) -> None:
    """Print a comparison: table, what was left out, what intervals mean, and the answer last."""
    if _headings(comparison) == ("A", "B"):
        console.print(Text(f"A: {plain(comparison.name_a)}\nB: {plain(comparison.name_b)}"), soft_wrap=True)
    console.print(comparison_summary(comparison))
    console.print(shift_summary(comparison))
    console.print(Text(f"{DEFINITIONS} {COMPONENT_DEFINITIONS}", style="dim"))
    for line in comparison.left_out:
        console.print(Text(f"left out: {plain(line)}", style="dim"))
    for note in comparison.remarks:
        console.print(Text(note, style="dim"))
    console.print(Text(_legend(comparison), style="dim"))
    console.print(Text(headline(comparison), style="bold"))


def print_gate(console: Console, checks: Sequence[GateCheck]) -> None:
    """Print the checks of a gate, failures first, and how many failed; nothing without rules."""
    if not checks:
        return
    table = gate_table(checks)
    console.print(_Fitting(console_table(table), _grouped(table)))
    console.print(Text(table.note, style="dim"))
    console.print(Text(f"Gate: {gate_sentence(checks)}.", style="bold"))


def print_planned_repeats(console: Console, planned: Sequence[PlannedRepeats], power: float) -> None:
    """Print how many repeats decide a comparison, the largest numbers first."""
    columns = [
        Column("trajectory", "trajectory"),
        Column("condition", "condition"),
        Column("quantity", "error"),
        Column("repeats", "n", 0),
        Column("sd", "sd", 2),
        Column("sd_limit", "80 % limit", 2),
        Column("margin", "margin", 1),
        Column("worse", "worse", 0, group="repeats for"),
        Column("same", "same", 0, group="repeats for"),
    ]
    rows = [
        [p.trajectory, p.condition, p.quantity.labelled, p.repeats, p.sd, p.sd_limit, p.margin, p.worse, p.same]
        for p in planned
    ]
    console.print(console_table(Table("planned", "Repeats that decide (of each side)", columns, rows)))
    console.print(Text(_PLANNED, style="dim"))
    console.print(Text(plan_in_words(planned, power), style="bold"))


_PLANNED = (
    "worse: the error has grown by two margins. same: nothing has changed. Normal noise with the 80 % limit of the "
    "measured standard deviation; rank-sum tests, corrected for all rows. Empty: more than 200 repeats."
)


def _legend(comparison: Comparison) -> str:
    """Return how verdicts are reached, with this comparison's margins."""
    margins = {f"{d.margin:g} {d.quantity.unit}" for d in comparison.differences}
    return (
        f"margins: ± {', ± '.join(sorted(margins))}. better or worse: beyond the margin, and beyond chance after"
        " correcting for all rows; same: within the margin; cannot say: neither could be shown, even where an interval"
        f" leaves out 0. {notes_in_words(comparison)}"
    ).rstrip()


def _styled(cell: str, column: Column) -> RenderableType:
    style = _VERDICT_STYLES.get(cell.split(" ", maxsplit=1)[0], "") if column.name == "verdict" else ""
    return Text(cell, style=style)
