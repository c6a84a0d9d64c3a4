"""Every condition against the next: difference, interval, test, effect size, verdict."""

from __future__ import annotations

from collections.abc import Sequence

from agvbench.reporting.content import Block, Column, Paragraph, Table, Value
from agvbench.reporting.sections.base import Section
from agvbench.statistics import Comparison, Difference
from agvbench.statistics.comparison_summary import describe, notes_in_words
from agvbench.statistics.differences import ALPHA_SAME
from agvbench.statistics.quantities import COMPONENT_DEFINITIONS
from agvbench.workflows.report import ReportData


def comparison_table(comparison: Comparison, slug: str) -> Table:
    """Return `comparison` with one row per trajectory, condition (where there are several) and quantity."""
    a, b = comparison.name_a, comparison.name_b
    columns = [
        Column("trajectory", "trajectory"),
        Column("condition", "condition"),
        Column("quantity", "error"),
        Column("repeats_a", "n", 0, group=a),
        Column("median_a", "median", 2, group=a),
        Column("repeats_b", "n", 0, group=b),
        Column("median_b", "median", 2, group=b),
        Column("difference", "median", 2, group="difference"),
        Column("low", "95 % from", 2, group="difference"),
        Column("high", "to", 2, group="difference"),
        Column("verdict", "verdict"),
        Column("p_corrected", "p (Holm)", 4, least=1e-4),
        Column("cliffs_delta", "Cliff's δ", 2),
        Column("words", "in words"),
    ]
    rows = [_row(d, comparison) for d in comparison.worst_first]
    if not comparison.has_several_conditions:
        # Named in the headings of both sides already.
        columns, rows = columns[:1] + columns[2:], [row[:1] + row[2:] for row in rows]
    note = (
        f"Rank-sum tests, one-sided, exact for small samples, corrected after Holm for {comparison.tests} comparisons "
        f"that could reach significance; {comparison.alpha:.0%} for any false alarm, "
        f"{ALPHA_SAME:.0%} for each “same within margin”. Intervals are each for itself. {notes_in_words(comparison)}"
    ).rstrip()
    return Table(slug, f"{b} against {a}: smaller errors are better.", columns, rows, grouped=True, note=note)


def shift_table(comparison: Comparison, slug: str) -> Table:
    """Return by how much the mean end position of each trajectory moved from A to B."""
    columns = [Column("trajectory", "trajectory"), Column("condition", "condition")]
    for part in ("along", "across"):
        columns += [
            Column(f"{part}_mm", "mean", 1, group=f"{part} [mm]"),
            Column(f"{part}_low", "95 % from", 1, group=f"{part} [mm]"),
            Column(f"{part}_high", "to", 1, group=f"{part} [mm]"),
        ]
    rows: list[list[Value]] = [[s.trajectory, s.condition, *s.along, *s.across] for s in comparison.shifts]
    caption = f"Mean end position of {comparison.name_b} minus that of {comparison.name_a}."
    note = (
        f"{COMPONENT_DEFINITIONS} Welch's intervals, each for itself. No verdict follows from this table; it "
        "shows runs that end as far from the target as before, on its other side."
    )
    return Table(slug, caption, columns, rows, note=note)


def _row(d: Difference, comparison: Comparison) -> list[Value]:
    return [
        d.trajectory,
        d.condition,
        d.quantity.labelled,
        *(d.a.repeats, d.a.median, d.b.repeats, d.b.median),
        *d.interval,
        d.shown_verdict,
        d.p_worse if d.interval.estimate > 0.0 else d.p_better,
        d.cliffs_delta,
        describe(d, comparison),
    ]


class ConditionsSection(Section):
    """Two tables per pair of conditions: errors with verdicts, and the shift of the mean end position."""

    slug, title, order = "conditions", "Conditions compared", 20

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the tables, or why there are none."""
        if not data.comparisons:
            return [Paragraph("No trajectory was driven under two conditions: nothing to compare.")]
        return [
            table(comparison, f"{slug}-{index}")
            for index, comparison in enumerate(data.comparisons, 1)
            for slug, table in (("comparison", comparison_table), ("end-shift", shift_table))
        ]
