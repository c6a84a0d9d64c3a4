"""The first screen: what calibration bought in plain words, where runs ended, the diagnosis, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from agvbench.plot.style import condition_numbers
from agvbench.plot.target_frame import ends_by_condition
from agvbench.reporting.content import Block, Bullets, FigureBlock, Panel, Paragraph, plain, plain_sentences
from agvbench.reporting.figures.clouds import draw_cloud, scale_of
from agvbench.reporting.figures.style import legend
from agvbench.reporting.next_steps import next_steps
from agvbench.reporting.sections.base import Section
from agvbench.reporting.sections.diagnosis import verdict_in_words
from agvbench.statistics import Comparison, ComparisonVerdict, Difference, valid
from agvbench.statistics.comparison_summary import describe, note_of
from agvbench.statistics.differences import ALL
from agvbench.statistics.quantities import DEFINITIONS, QUANTITIES
from agvbench.workflows.report import ReportData

if TYPE_CHECKING:
    import pandas as pd

_BOUGHT = {
    ("uncalibrated", "calibrated"): "Calibration",
    ("calibrated", "corrected"): "The correction",
    ("uncalibrated", "corrected"): "Calibration and correction",
}
_MOST_NAMED = 6
_PLAIN = (
    "The end position error is the distance between where a run stopped and where it was to stop, as the cameras "
    "measured it. The heading error is how far the vehicle then pointed past its target heading."
)
_CLOUDS = (
    "Where every run stopped, seen from its target (the cross; ahead is to the right). The ring has a radius of "
    "{ring_mm:g} mm, the same in each panel. An ellipse holds a further run with 95 % probability, if end positions "
    "are normally distributed; it needs four repeats."
)


class HeadlineSection(Section):
    """One sentence per pair of conditions, the end poses, the verdict of the diagnosis, what is next, and details."""

    slug, title, order = "headline", "In short", 10

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the sentences."""
        lead = [Paragraph(sentence, lead=True) for sentence in _lead(data)]
        said = (item for comparison in data.comparisons for item in _details(comparison))
        details = list(dict.fromkeys((*said, *data.problems)))
        blocks: list[Block] = [*lead, *(Paragraph(plain_sentences(sentence)) for sentence in data.compared)]
        if len(data.end_poses):
            blocks += [Paragraph(_PLAIN), *cloud_figure(data)]
        if data.diagnosis is not None and data.diagnosis.content:
            blocks.append(Paragraph(f"Diagnosis: {verdict_in_words(data.diagnosis.content)}"))
        blocks.append(Paragraph(f"Next: {' '.join(next_steps(data))}"))
        blocks += [Bullets(details)] if details else []
        return [*blocks, Paragraph(DEFINITIONS)] if len(data.end_poses) else blocks


def cloud_figure(data: ReportData, *, slug: str = "clouds", small: bool = True) -> Iterator[FigureBlock]:
    """Yield a figure of end positions with their ellipses, a panel per trajectory, all with one scale."""
    counted, numbers = valid(data.errors), condition_numbers(data.conditions)
    if counted.empty:
        return
    grouped = counted.groupby("trajectory", sort=False)
    by_trajectory = {str(name): ends_by_condition(rows, numbers) for name, rows in grouped}
    ring_mm, half_mm = scale_of(by_trajectory.values())
    scale = {"ring_mm": ring_mm, "half_mm": half_mm}
    panels = [Panel(plain(name), draw_cloud(ends, **scale)) for name, ends in by_trajectory.items()]
    named = legend({c: n for c, n in numbers.items() if c in set(counted["condition"])})
    yield FigureBlock(slug, _CLOUDS.format(ring_mm=ring_mm), panels, named, small=small)


def _lead(data: ReportData) -> list[str]:
    if data.comparisons:
        return [_bought(comparison) for comparison in data.comparisons]
    counted = valid(data.errors)
    if counted.empty:
        return [f"None of the {len(data.runs)} runs has both a target and a measured end pose: no errors to report."]
    return [
        _reached(counted[counted["condition"] == c], plain(c))
        for c in data.conditions
        if c in set(counted["condition"])
    ]


def _bought(comparison: Comparison) -> str:
    subject = _BOUGHT.get(
        (comparison.name_a, comparison.name_b), f"Going from {comparison.name_a} to {comparison.name_b}"
    )
    counted = [d for d in comparison.deciding if d.trajectory != ALL]
    trajectories = len({d.trajectory for d in counted})
    where = f"on average over {trajectories} trajectories" if trajectories > 1 else f"on {counted[0].trajectory}"
    *first, last = map(_moved, _summary(comparison))
    moved = f"{', '.join(first)} and {last}"
    better, worse = (sum(d.verdict is v for d in counted) for v in (ComparisonVerdict.BETTER, ComparisonVerdict.WORSE))
    score = (
        f"Of {len(counted)} medians of end position and heading error {better or 'none'} improved beyond doubt, "
        f"{worse or 'none'} got worse"
    )
    return plain_sentences(f"{subject} changed {moved}, {where}. {score}.")


def _summary(comparison: Comparison) -> list[Difference]:
    """Return the difference of each quantity, over all trajectories."""
    together = [d for d in comparison.differences if d.trajectory == ALL]
    return together or list(comparison.differences)


def _moved(d: Difference) -> str:
    digits, unit = d.quantity.digits, d.quantity.unit
    numbers = f"from {d.a.median:.{digits}f} to {d.b.median:.{digits}f} {unit}"
    return f"the median {d.quantity.name} {numbers} ({d.verdict})"


def _reached(rows: pd.DataFrame, condition: str) -> str:
    medians = (f"{q.name} {np.median(rows[q.column].abs()):.{q.digits}f} {q.unit}" for q in QUANTITIES)
    return f"Under the condition {condition}, medians of {len(rows)} runs are: {', '.join(medians)}."


def _details(comparison: Comparison) -> Iterator[str]:
    pair = f"{comparison.name_a} → {comparison.name_b}"
    for verdict, lead in ((ComparisonVerdict.WORSE, "Worse"), (ComparisonVerdict.INCONCLUSIVE, "Cannot say")):
        found = [d for d in comparison.of(verdict) if d.trajectory != ALL]
        if found:
            named = "; ".join(
                f"{plain(d.trajectory)} {d.quantity.name} ({describe(d, comparison)})" for d in found[:_MOST_NAMED]
            )
            more = f"; and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
            yield f"{lead}, {pair}: {named}{more}."
    if note := note_of(comparison):
        yield plain_sentences(f"{pair}: {note}")
    yield from comparison.remarks
