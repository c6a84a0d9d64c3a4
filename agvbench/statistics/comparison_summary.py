"""A comparison in plain words and as JSON (schema 1)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from agvbench.notebook_html import heading_html, table_html
from agvbench.statistics.differences import ComparisonVerdict, Difference, EndShift, SampleSummary
from agvbench.statistics.hypothesis_tests import required_sample_size
from agvbench.statistics.intervals import CONFIDENCE
from agvbench.statistics.quantities import DISTANCE, HEADING

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.statistics.comparison import Comparison


def describe(difference: Difference, comparison: Comparison) -> str:
    """Return what one difference of `comparison` amounts to, as a clause."""
    if difference.verdict in (ComparisonVerdict.WORSE, ComparisonVerdict.BETTER):
        return f"{_amount(difference, abs(difference.interval.estimate))} {difference.verdict}"
    if difference.verdict is ComparisonVerdict.SAME:
        return f"the same to within {_amount(difference, difference.margin)}"
    if not difference.testable:
        return _too_few(difference, comparison)
    return _undecided(difference, comparison.alpha)


def headline(comparison: Comparison) -> str:
    """Return the comparison's answer: a sentence by what decides, and one about notes that say something else."""
    worse, better = len(comparison.of(ComparisonVerdict.WORSE)), len(comparison.of(ComparisonVerdict.BETTER))
    same, unknown = len(comparison.of(ComparisonVerdict.SAME)), len(comparison.of(ComparisonVerdict.INCONCLUSIVE))
    if not comparison.could_compare:
        return f"Could not compare: {describe(comparison.of(ComparisonVerdict.INCONCLUSIVE)[0], comparison)}."
    counts = [f"{worse} worse", f"{better} better", f"{same} the same within the margin", f"{unknown} undecided"]
    answer = "Regression" if worse else "No regression shown"
    decided = f"{answer}: of {len(comparison.deciding)} comparisons {', '.join(counts)}."
    return f"{decided} {note}" if (note := note_of(comparison)) else decided


def notes_in_words(comparison: Comparison) -> str:
    """Return what verdicts in brackets are; "" where every verdict decides."""
    names = dict.fromkeys(d.quantity.name for d in comparison.differences if not d.decides)
    if not names:
        return ""
    return f"In brackets: {', '.join(names)} as the thesis defines it, corrected by itself, which decides nothing."


def note_of(comparison: Comparison) -> str:
    """Return the sentence about trajectories that only quantities which do not decide call worse; "" if none does."""
    found = comparison.noted_worse
    if not found:
        return ""
    several = comparison.has_several_conditions
    where = dict.fromkeys(f"{d.trajectory} {d.condition}" if several else d.trajectory for d in found)
    name = " and ".join(dict.fromkeys(d.quantity.name for d in found))
    return f"Note: {name}, as the thesis defines it, is worse alone in {', '.join(where)}, which is no regression."


def _amount(difference: Difference, value: float) -> str:
    quantity = difference.quantity
    return f"{value:.{quantity.digits}f} {quantity.unit}"


def _too_few(difference: Difference, comparison: Comparison) -> str:
    a, b = difference.a.repeats, difference.b.repeats
    repeats = f"{a} repeats" if a == b else f"{a} against {b} repeats"
    # Where repeats are few, |Δs| is left out so that end poses can be judged.
    family = [d for d in comparison.differences if d.decides == difference.decides]
    among = [d for d in family if difference.quantity == DISTANCE or d.quantity != DISTANCE]
    needed = required_sample_size(comparison.alpha / len(among))
    return f"{repeats} cannot show any difference here, however large; {needed} of each could"


def _undecided(difference: Difference, alpha: float) -> str:
    significant = min(difference.p_worse, difference.p_better) <= alpha
    if significant:
        way = ComparisonVerdict.WORSE if difference.p_worse <= alpha else ComparisonVerdict.BETTER
        return f"{way}, but perhaps by no more than the margin of {_amount(difference, difference.margin)}"
    if not math.isfinite(difference.minimum_detectable):
        return "no repeats to judge by"
    fewest = min(difference.a.repeats, difference.b.repeats)
    amount = _amount(difference, difference.minimum_detectable)
    return f"{fewest} repeats cannot show a difference smaller than about {amount}"


SCHEMA = 1


def comparison_to_json(comparison: Comparison) -> dict[str, Any]:
    """Return `comparison` as what `json.dumps` takes; numbers that are not finite become null."""
    return {
        "schema": SCHEMA,
        "a": comparison.name_a,
        "b": comparison.name_b,
        "regression": comparison.is_regression,
        "could_compare": comparison.could_compare,
        "headline": headline(comparison),
        "alpha": comparison.alpha,
        "tests": comparison.tests,
        "trajectories": [
            {"trajectory": trajectory, "condition": condition, "verdict": str(verdict)}
            for (trajectory, condition), verdict in comparison.verdicts.items()
        ],
        "differences": [_difference(d, comparison) for d in comparison.differences],
        "end_shifts": [_shift(shift) for shift in comparison.shifts],
        "left_out": list(comparison.left_out),
        "notes": list(comparison.remarks),
    }


def _difference(d: Difference, comparison: Comparison) -> dict[str, Any]:
    return {
        "trajectory": d.trajectory,
        "condition": d.condition,
        "quantity": f"abs_{d.quantity.column}" if d.quantity in (HEADING, DISTANCE) else d.quantity.column,
        "unit": d.quantity.unit,
        "margin": d.margin,
        "a": _sample(d.a),
        "b": _sample(d.b),
        "difference": _finite(d.interval.estimate),
        "interval": {"low": _finite(d.interval.low), "high": _finite(d.interval.high), "confidence": CONFIDENCE},
        "p_worse": d.p_worse,
        "p_better": d.p_better,
        "p_same": d.p_same,
        "cliffs_delta": d.cliffs_delta,
        "smallest_visible_difference": _finite(d.minimum_detectable),
        "verdict": str(d.verdict),
        "decides": d.decides,
        "words": describe(d, comparison),
    }


def _shift(shift: EndShift) -> dict[str, Any]:
    parts = {"along_mm": shift.along, "across_mm": shift.across}
    return {
        "trajectory": shift.trajectory,
        "condition": shift.condition,
        **{
            name: {"difference": part.estimate, "low": _finite(part.low), "high": _finite(part.high)}
            for name, part in parts.items()
        },
    }


def _sample(sample: SampleSummary) -> dict[str, Any]:
    return {
        "repeats": sample.repeats,
        "median": _finite(sample.median),
        "sd": _finite(sample.sd),
        "outliers": sample.outliers,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


_COLUMNS = (
    *("trajectory", "condition", "quantity", "unit", "repeats_a", "median_a", "repeats_b", "median_b"),
    *("difference", "low", "high", "margin", "verdict", "decides", "p_worse", "p_better", "cliffs_delta"),
)
_SHOWN = ("trajectory", "condition", "quantity", "unit", "median_a", "median_b", "difference", "low", "high")


def differences_frame(comparison: Comparison) -> pd.DataFrame:
    """Return one row per difference, worst first; see `Comparison.differences_frame`."""
    import pandas as pd

    return pd.DataFrame([_row(d) for d in comparison.worst_first], columns=list(_COLUMNS))


def _row(d: Difference) -> tuple[object, ...]:
    return (
        *(d.trajectory, d.condition, d.quantity.column, d.quantity.unit),
        *(d.a.repeats, d.a.median, d.b.repeats, d.b.median),
        *(d.interval.estimate, d.interval.low, d.interval.high, d.margin),
        *(str(d.verdict), d.decides, d.p_worse, d.p_better, d.cliffs_delta),
    )


def comparison_html(comparison: Comparison) -> str:
    """Return the answer, and each difference of medians with its 95 % interval and verdict, worst first."""
    sides = f"{comparison.name_b} against {comparison.name_a}: smaller errors are better."
    verdicts = [d.shown_verdict for d in comparison.worst_first]
    frame = differences_frame(comparison)[list(_SHOWN)].assign(verdict=verdicts)
    titles = ["trajectory", "condition", "error", "unit", comparison.name_a, comparison.name_b]
    table = table_html(
        "medians, and their difference with its 95 % interval",
        [*titles, "difference", "from", "to", "verdict"],
        frame.itertuples(index=False),
    )
    return heading_html(headline(comparison), sides, notes_in_words(comparison), *comparison.notes) + table
