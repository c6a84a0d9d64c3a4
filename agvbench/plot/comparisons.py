"""The differences of a comparison with their intervals, beside the margin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.errors import InputError
from agvbench.plot.style import ON_WHITE, label, literal
from agvbench.statistics.differences import ALL, ComparisonVerdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from agvbench.statistics import Comparison, Difference

# Blue, vermilion and grey: verdicts are in words, too.
_COLOURS = {
    ComparisonVerdict.WORSE: "#d55e00",
    ComparisonVerdict.BETTER: "#0072b2",
    ComparisonVerdict.SAME: "#009e73",
    ComparisonVerdict.INCONCLUSIVE: "#7f7f7f",
}


def comparison(axes: Axes, compared: Comparison, *, quantity: str = "position_mm") -> Axes:
    """Draw the difference of medians of each trajectory and condition with its 95 % interval, worst on top.

    To the right of zero the second side is worse. The band is the margin.

    Parameters
    ----------
    axes
        Where to draw, in the unit of the quantity.
    compared
        What `agvbench.compare` returned.
    quantity
        ``"position_mm"``, ``"delta_heading_deg"`` or ``"delta_s_mm"``.

    Raises
    ------
    InputError
        If this quantity was not compared.
    """
    chosen = [d for d in compared.worst_first if d.quantity.column == quantity]
    if not chosen:
        known = ", ".join(dict.fromkeys(d.quantity.column for d in compared.differences))
        raise InputError("was not compared", where="quantity", value=repr(quantity), limit=known)
    first = chosen[0]
    sides = f"{compared.name_b} minus {compared.name_a}"
    label(axes, x=f"{first.quantity.name} [{first.quantity.unit}]", y="", title=sides)
    axes.axvspan(-first.margin, first.margin, color=ON_WHITE.grid, alpha=0.6, linewidth=0.0)
    axes.axvline(0.0, color=ON_WHITE.ink, linewidth=0.8)
    for height, difference in enumerate(chosen):
        _draw(axes, difference, height)
    axes.set_yticks(range(len(chosen)), [_name(d, several=compared.has_several_conditions) for d in chosen])
    axes.set_ylim(len(chosen) - 0.5, -0.5)
    return axes


def _draw(axes: Axes, difference: Difference, height: int) -> None:
    estimate, low, high = difference.interval
    shown = _COLOURS[difference.verdict]
    axes.plot([low, high], [height, height], color=shown, linewidth=2.0, solid_capstyle="butt")
    axes.plot(estimate, height, marker="o", color=shown)


def _name(difference: Difference, *, several: bool) -> str:
    condition = f", {difference.condition}" if several and difference.trajectory != ALL else ""
    return literal(f"{difference.trajectory}{condition}\n{difference.shown_verdict}")
