"""How figures look: one colour and marker per condition, and the ink of everything else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from agvbench.errors import InputError
from agvbench.types import CONDITIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito (2008), in the order of the conditions; markers repeat what colours say.
CONDITION_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
MARKERS = ("o", "s", "^", "D", "v", "P")


@dataclass(frozen=True)
class Ink:
    """Colours of lines and text: ``ink`` for what counts, ``muted``, ``grid``, and ``paper`` for outlines of marks."""

    ink: str = "black"
    muted: str = "dimgray"
    grid: str = "gainsboro"
    paper: str = "white"


ON_WHITE = Ink()


def colour(index: int) -> str:
    """Return the colour of the condition with this number."""
    return CONDITION_COLOURS[index % len(CONDITION_COLOURS)]


def marker(index: int) -> str:
    """Return the marker of the condition with this number."""
    return MARKERS[index % len(MARKERS)]


def condition_numbers(conditions: Sequence[str]) -> dict[str, int]:
    """Return the number of every condition; the known ones keep theirs whether the others are there or not.

    >>> condition_numbers(["calibrated", "by_hand"])
    {'calibrated': 1, 'by_hand': 3}
    """
    others = [condition for condition in conditions if condition not in CONDITIONS]
    known = {c: CONDITIONS.index(c) for c in conditions if c in CONDITIONS}
    return known | {c: len(CONDITIONS) + index for index, c in enumerate(others)}


def label(axes: Axes, *, x: str, y: str, title: str = "") -> None:
    """Label `axes`, with a quiet grid below what is drawn; an empty title is none. Names may hold a dollar sign."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(color=ON_WHITE.grid, linewidth=0.6)
    axes.set_axisbelow(True)
    if title:
        axes.set_title(literal(title))


def trajectory_title(name: str) -> str:
    """Return the title of axes about one trajectory: many are named by a number alone."""
    return f"trajectory {name}" if name else ""


def require_result(value: object, attribute: str, *, where: str, made_by: str) -> None:
    """Refuse an argument that is not what the function `made_by` returned, which has this attribute.

    Raises
    ------
    InputError
        If it is not; `where` is the argument's name.
    """
    if not hasattr(value, attribute):
        remedy = f"give what {made_by} returned"
        raise InputError("cannot be drawn", where=where, value=type(value).__name__, remedy=remedy)


def literal(name: str) -> str:
    r"""Return `name` for matplotlib, to which dollar signs begin a formula.

    >>> literal("5$")
    '5\\$'
    """
    return name.replace("$", r"\$")
