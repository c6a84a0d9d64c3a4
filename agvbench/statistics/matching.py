"""Match two sets of runs: cells of one trajectory (and condition), split by session where shared."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agvbench.errors import InputError, OneOf
from agvbench.statistics.quantities import ACROSS, ALONG, QUANTITIES, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

Strata = list[tuple[Floats, Floats]]
_Key = tuple[str, ...]
_TARGET = ["target_x_m", "target_y_m", "target_heading_rad"]
_TARGET_TOLERANCE = np.array([1e-3, 1e-3, math.radians(0.1)])


@dataclass(frozen=True)
class Side:
    """The runs of one side of a cell: absolute errors by column and sessions, of shape (n,), and the target.

    ``ends_mm`` (n, 2) are the end positions minus the target's, along and across.
    """

    absolute: dict[str, Floats]
    ends_mm: Floats
    session: NDArray[np.object_]
    target: Floats

    def values(self, quantity: Quantity, session: str | None = None) -> Floats:
        """Return the absolute errors, of all runs or of one session; those of runs that have one."""
        values = self.absolute[quantity.column]
        chosen = values if session is None else values[self.session == session]
        return chosen[np.isfinite(chosen)]

    @property
    def sessions(self) -> list[str]:
        """Return the distinct sessions, in order of appearance."""
        return list(dict.fromkeys(self.session))


@dataclass(frozen=True)
class Cell:
    """The runs of one trajectory under one condition (or one condition against another) on both sides."""

    trajectory: str
    condition: str
    a: Side
    b: Side
    by_session: bool

    def values(self, quantity: Quantity) -> tuple[Floats, Floats]:
        """Return the absolute errors of both sides."""
        return self.a.values(quantity), self.b.values(quantity)

    def has(self, quantity: Quantity) -> bool:
        """Whether both sides have runs with this quantity."""
        return all(map(len, self.values(quantity)))

    def strata(self, quantity: Quantity) -> Strata:
        """Return the absolute errors of both sides, one pair per session that both sides share."""
        if not self.by_session:
            return [self.values(quantity)]
        shared = [s for s in self.a.sessions if s in self.b.sessions]
        return [(self.a.values(quantity, s), self.b.values(quantity, s)) for s in shared]


def match_cells(
    a: pd.DataFrame,
    b: pd.DataFrame,
    *,
    conditions: tuple[str, str] | None,
    same_campaign: bool,
    quantities: Sequence[Quantity] = QUANTITIES,
) -> tuple[list[Cell], list[str]]:
    """Return the cells that `a` and `b` have in common, and a sentence about every one that is left out.

    ``quantities`` are the columns of `a` and `b` that will be compared.

    Raises
    ------
    InputError
        If nothing is in common, or a side lacks the condition that was asked for.
    """
    a, b = _counted(a, "A"), _counted(b, "B")
    if conditions is not None:
        a, b = _of_condition(a, conditions[0], "A"), _of_condition(b, conditions[1], "B")
    keys = ["trajectory"] if conditions is not None else ["trajectory", "condition"]
    sides_a, sides_b = _sides(a, keys, quantities), _sides(b, keys, quantities)
    label = None if conditions is None else " → ".join(conditions)
    cells, left_out = [], []
    for key, side in sides_a.items():
        other = sides_b.get(key)
        if other is None:
            left_out.append(f"{' '.join(key)}: only in A")
        elif not same_target(side.target, other.target):
            left_out.append(f"{' '.join(key)}: the targets differ")
        else:
            by_session = same_campaign and _share_sessions(side, other)
            cells.append(Cell(key[0], label or key[-1], side, other, by_session))
    left_out += [f"{' '.join(key)}: only in B" for key in sides_b if key not in sides_a]
    if not cells:
        raise _nothing_in_common(a, b)
    return cells, left_out


def _sides(errors: pd.DataFrame, keys: list[str], quantities: Sequence[Quantity]) -> dict[_Key, Side]:
    groups = errors.groupby([errors[key].astype(str) for key in keys], sort=False)
    return {tuple(map(str, key)): _side(rows, quantities) for key, rows in groups}


def _side(rows: pd.DataFrame, quantities: Sequence[Quantity]) -> Side:
    return Side(
        absolute={q.column: np.abs(rows[q.column].to_numpy(dtype=float)) for q in quantities},
        ends_mm=rows[[ALONG.column, ACROSS.column]].to_numpy(dtype=float),
        session=rows["session"].to_numpy(dtype=object),
        target=rows[_TARGET].to_numpy(dtype=float)[0],
    )


def _counted(errors: pd.DataFrame, side: str) -> pd.DataFrame:
    counted = valid(errors)
    if counted.empty:
        why = "no run with a target" if errors.empty else f"none of {len(errors)} runs with a target is ok"
        raise InputError(f"{side} has no run that counts", value=why, remedy="drive the trajectories again")
    return counted


def _of_condition(errors: pd.DataFrame, condition: str, side: str) -> pd.DataFrame:
    chosen = errors[errors["condition"] == condition]
    if chosen.empty:
        raise InputError(
            f"{side} has no run under this condition",
            where="--conditions",
            value=condition,
            limit=OneOf(sorted(set(errors["condition"]))),
        )
    return chosen


def same_target(a: ArrayLike, b: ArrayLike, tolerance: ArrayLike = _TARGET_TOLERANCE) -> bool:
    """Return whether two targets (x [m], y [m], heading [rad]) agree, by default within 1 mm and 0.1°.

    Half a turn is the same to either side. A number that both lack agrees.
    """
    apart = np.subtract(a, b)
    apart[2] = np.angle(np.exp(1j * apart[2]))
    return bool(np.all((np.abs(apart) <= tolerance) | (np.isnan(a) & np.isnan(b))))


def _share_sessions(a: Side, b: Side) -> bool:
    return bool(set(a.sessions) & set(b.sessions)) and len(set(a.sessions) | set(b.sessions)) > 1


def _nothing_in_common(a: pd.DataFrame, b: pd.DataFrame) -> InputError:
    return InputError(
        "nothing to compare: no trajectory under the same condition with the same target in both",
        value="; ".join(_have(a, b)),
        remedy="name the conditions with --conditions, or compare campaigns that drove the same trajectories",
    )


def _have(a: pd.DataFrame, b: pd.DataFrame) -> Iterator[str]:
    for side, rows in (("A", a), ("B", b)):
        pairs: list[Any] = list(dict.fromkeys(zip(rows["trajectory"], rows["condition"], strict=True)))
        shown = [f"{trajectory} {condition}" for trajectory, condition in pairs]
        yield f"{side} has {', '.join(shown[:4])}{', …' if len(shown) > 4 else ''}"
