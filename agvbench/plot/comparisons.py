"""The differences of a comparison with their intervals, beside the margin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.errors import InputError, OneOf
from agvbench.plot.style import ON_WHITE, label, literal, require_result
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


_LARGEST_PT, _SHARE_OF_ROW, _PT_PER_INCH = 10.0, 0.8, 72.0


def comparison(axes: Axes, compared: Comparison, *, quantity: str = "position_mm") -> Axes:
    """Draw the difference of medians of each trajectory and condition with its 95 % interval, worst on top.

    To the right of zero the second side is worse. The band is the margin. The verdict stands to the right of the axes,
    in brackets if the quantity does not decide. Text is as large as the rows are high, at most 10 pt; names and
    verdicts lie outside the axes, for which ``layout="constrained"`` makes room.

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
        If `compared` is no comparison, or this quantity was not compared.
    """
    require_result(compared, "worst_first", where="compared", made_by="agvbench.compare")
    chosen = [d for d in compared.worst_first if d.quantity.column == quantity]
    if not chosen:
        known = OneOf(dict.fromkeys(d.quantity.column for d in compared.differences))
        raise InputError("was not compared", where="quantity", value=repr(quantity), limit=known)
    first = chosen[0]
    sides = f"{compared.name_b} minus {compared.name_a}"
    label(axes, x=f"{first.quantity.name} [{first.quantity.unit}]", y="", title=sides)
    axes.axvspan(-first.margin, first.margin, color=ON_WHITE.grid, alpha=0.6, linewidth=0.0)
    axes.axvline(0.0, color=ON_WHITE.ink, linewidth=0.8)
    size = _font_size(axes, len(chosen))
    for height, difference in enumerate(chosen):
        _draw(axes, difference, height, size)
    names = [_name(d, several=compared.has_several_conditions) for d in chosen]
    axes.set_yticks(range(len(chosen)), names, fontsize=size)
    axes.set_ylim(len(chosen) - 0.5, -0.5)
    return axes


def _font_size(axes: Axes, rows: int) -> float:
    """Return the size [pt] at which one line fits into a row."""
    height_pt = axes.get_window_extent().height * _PT_PER_INCH / axes.figure.dpi
    return min(_LARGEST_PT, _SHARE_OF_ROW * height_pt / rows)


def _draw(axes: Axes, difference: Difference, height: int, size: float) -> None:
    estimate, low, high = difference.interval
    shown = _COLOURS[difference.verdict]
    axes.plot([low, high], [height, height], color=shown, linewidth=0.2 * size, solid_capstyle="butt")
    axes.plot(estimate, height, marker="o", markersize=0.6 * size, color=shown)
    beside = axes.get_yaxis_transform()
    said = difference.shown_verdict
    axes.text(1.02, height, said, transform=beside, va="center_baseline", fontsize=size, color=shown)


def _name(difference: Difference, *, several: bool) -> str:
    condition = f", {difference.condition}" if several and difference.trajectory != ALL else ""
    return literal(f"{difference.trajectory}{condition}")
