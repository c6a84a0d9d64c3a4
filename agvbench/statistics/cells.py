"""What two sets of runs have in common: cells of the same trajectory (and condition), split by session where shared."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import InputError
from agvbench.statistics.quantities import Quantity
from agvbench.statistics.runs import valid
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

Strata = list[tuple[Floats, Floats]]
_TARGET = ["target_x_m", "target_y_m", "target_heading_rad"]
_TARGET_TOLERANCE = np.array([1e-3, 1e-3, math.radians(0.1)])


@dataclass(frozen=True)
class Cell:
    """The runs of one trajectory under one condition (or one condition against another) on both sides."""

    trajectory: str
    condition: str
    a: pd.DataFrame
    b: pd.DataFrame
    by_session: bool

    def values(self, quantity: Quantity) -> tuple[Floats, Floats]:
        """Return the absolute errors of both sides."""
        return _absolute(self.a, quantity), _absolute(self.b, quantity)

    def strata(self, quantity: Quantity) -> Strata:
        """Return the absolute errors of both sides, one pair per session that both sides share."""
        if not self.by_session:
            return [self.values(quantity)]
        shared = [s for s in dict.fromkeys(self.a["session"]) if s in set(self.b["session"])]
        return [
            (_absolute(self.a[self.a["session"] == s], quantity), _absolute(self.b[self.b["session"] == s], quantity))
            for s in shared
        ]


def match_cells(
    a: pd.DataFrame, b: pd.DataFrame, *, conditions: tuple[str, str] | None, same_campaign: bool
) -> tuple[list[Cell], list[str]]:
    """Return the cells that `a` and `b` have in common, and a sentence about every one that is left out.

    Raises
    ------
    InputError
        If nothing is in common, or a side lacks the condition that was asked for.
    """
    a, b = _counted(a, "A"), _counted(b, "B")
    if conditions is not None:
        a, b = _of_condition(a, conditions[0], "A"), _of_condition(b, conditions[1], "B")
    keys = ["trajectory"] if conditions is not None else ["trajectory", "condition"]
    groups_a, groups_b = (_grouped(side, keys) for side in (a, b))
    cells, left_out = [], []
    label = None if conditions is None else " → ".join(conditions)
    for key, rows in groups_a.items():
        name = " ".join(key)
        if key not in groups_b:
            left_out.append(f"{name}: only in A")
        elif not _same_target(rows, groups_b[key]):
            left_out.append(f"{name}: the targets differ")
        else:
            by_session = same_campaign and _share_sessions(rows, groups_b[key])
            cells.append(Cell(key[0], label or key[-1], rows, groups_b[key], by_session))
    left_out += [f"{' '.join(key)}: only in B" for key in groups_b if key not in groups_a]
    if not cells:
        raise InputError(
            "nothing to compare: no trajectory under the same condition with the same target in both",
            value="; ".join(_have(a, b)),
            remedy="name the conditions with --conditions, or compare campaigns that drove the same trajectories",
        )
    return cells, left_out


def _grouped(side: pd.DataFrame, keys: list[str]) -> dict[tuple[str, ...], pd.DataFrame]:
    return {tuple(map(str, key)): rows for key, rows in side.groupby(keys, sort=False)}


def _absolute(rows: pd.DataFrame, quantity: Quantity) -> Floats:
    return np.asarray(rows[quantity.column].abs().to_numpy(dtype=float))


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
            limit=f"one of {', '.join(sorted(set(errors['condition'])))}",
        )
    return chosen


def _same_target(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    apart = a[_TARGET].to_numpy(dtype=float)[0] - b[_TARGET].to_numpy(dtype=float)[0]
    apart[2] = np.angle(np.exp(1j * apart[2]))
    return bool(np.all(np.abs(apart) <= _TARGET_TOLERANCE))


def _share_sessions(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    return bool(set(a["session"]) & set(b["session"])) and len(set(a["session"]) | set(b["session"])) > 1


def _have(a: pd.DataFrame, b: pd.DataFrame) -> Iterator[str]:
    for side, rows in (("A", a), ("B", b)):
        pairs = rows[["trajectory", "condition"]].drop_duplicates()
        shown = [f"{t} {c}" for t, c in pairs.itertuples(index=False)]
        yield f"{side} has {', '.join(shown[:4])}{', …' if len(shown) > 4 else ''}"
