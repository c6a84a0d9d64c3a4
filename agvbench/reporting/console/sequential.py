"""A sequential comparison on the console: the verdicts, and what driving until decided came to."""

from __future__ import annotations

from rich.console import RenderableType

from agvbench.reporting.console.tables import console_table
from agvbench.reporting.content import Column, Table, Value
from agvbench.statistics import ComparisonVerdict
from agvbench.statistics.differences import ALL
from agvbench.statistics.quantities import END_POSE
from agvbench.statistics.repeats.sequential import Decision, SequentialVerdict
from agvbench.workflows.comparison.sequential_record import SequentialRecord

_ORDER = (
    ComparisonVerdict.WORSE,
    ComparisonVerdict.INCONCLUSIVE,
    ComparisonVerdict.BETTER,
    ComparisonVerdict.SAME,
)
_SHOWN = {ComparisonVerdict.INCONCLUSIVE: "open", ComparisonVerdict.SAME: "same"}
_QUANTITIES = {quantity.column: quantity for quantity in END_POSE}


def sequential_summary(record: SequentialRecord) -> RenderableType:
    """Return the verdicts as a table, worse before open ones."""
    columns = [
        Column("trajectory", "trajectory"),
        Column("condition", "condition"),
        Column("quantity", "error"),
        Column("difference", "change", 2),
        Column("margin", "margin", 1),
        Column("p_worse", "worse", 4, group="p", least=1e-4),
        Column("p_better", "better", 4, group="p", least=1e-4),
        Column("p_same", "same", 4, group="p", least=1e-4),
        Column("verdict", "verdict"),
    ]
    ordered = sorted(record.verdicts, key=lambda v: (_ORDER.index(v.verdict), -v.difference / v.margin))
    caption = f"Sequential comparison with {record.against} (medians; p-values corrected for rows and analyses)"
    return console_table(Table("sequential", caption, columns, [_row(verdict) for verdict in ordered]))


def _row(v: SequentialVerdict) -> list[Value]:
    trajectory, condition, column = v.key
    named: list[Value] = [trajectory, condition, _QUANTITIES[column].labelled]
    shown = _SHOWN.get(v.verdict, str(v.verdict))
    return [*named, v.difference, v.margin, v.p_worse, v.p_better, v.p_same, shown]


def decision_in_words(record: SequentialRecord, driven: int, saved: int) -> str:
    """Return the decision, after how many repeats and analyses, and how many runs were driven and saved."""
    count = len(record.analyses)
    after = (
        f"after {record.repeats} of at most {record.plan.most_repeats} repeats and "
        f"{count} {'analysis' if count == 1 else 'analyses'}"
    )
    runs = f"{driven} runs of trajectories driven, {saved} saved ({saved / max(1, driven + saved):.0%})"
    return f"{_found(record)} {after}; {runs}."


def _found(record: SequentialRecord) -> str:
    found = record.verdicts
    if record.decision is Decision.OPEN:
        return f"Not decided ({sum(v.is_open for v in found)} of {len(found)} comparisons are open)"
    if record.decision is Decision.NO_REGRESSION:
        better = sum(v.verdict is ComparisonVerdict.BETTER for v in found)
        return f"No regression: {better} of {len(found)} comparisons better, the others the same within the margin,"
    worse = [v for v in found if v.verdict is ComparisonVerdict.WORSE]
    named = [f"{_QUANTITIES[v.key[2]].name} of {v.key[0] if v.key[0] == ALL else ' '.join(v.key[:2])}" for v in worse]
    return f"Regression: {', '.join(named)},"
