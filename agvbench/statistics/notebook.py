"""How a notebook shows a comparison: as a table of pandas, and as HTML."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.notebook_html import heading_html, table_html
from agvbench.statistics.comparison_summary import headline, notes_in_words

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.statistics.comparison import Comparison
    from agvbench.statistics.differences import Difference

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
    return heading_html(headline(comparison), sides, notes_in_words(comparison)) + table
