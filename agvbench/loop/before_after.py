"""End position errors before and after the correction, trajectory by trajectory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.statistics.equivalence import Bias, Equivalence, equivalences
from agvbench.statistics.quantities import COMPONENTS, DISTANCE, POSITION, Quantity
from agvbench.statistics.run_errors import valid
from agvbench.types import CONDITIONS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class BeforeAfter:
    """One trajectory and quantity: its bias under each condition that was driven."""

    trajectory: str
    quantity: Quantity
    by_condition: dict[str, Equivalence]

    @property
    def corrected(self) -> Equivalence | None:
        """The bias that is left, if the condition was driven."""
        return self.by_condition.get("corrected")


@dataclass(frozen=True)
class EndPosition:
    """One trajectory: its median end position error [mm] and the bias of its Δs [mm], under each condition."""

    trajectory: str
    median_mm: dict[str, float]
    delta_s: dict[str, Equivalence]


def before_after(errors: pd.DataFrame, quantities: Sequence[Quantity] = COMPONENTS) -> list[BeforeAfter]:
    """Return a row per trajectory and quantity from what `pose_errors` returns; along, across and heading by default.

    The three components of the end pose's error are tested, and not Δs and Δδ: a bias across shows in neither.
    """
    found = {condition: equivalences(errors, condition, quantities) for condition in CONDITIONS}
    keys = dict.fromkeys(key for cells in found.values() for key in cells)
    by_column = {quantity.column: quantity for quantity in quantities}
    order = {name: i for i, name in enumerate(dict.fromkeys(errors["trajectory"]))}
    return [
        BeforeAfter(
            name, by_column[column], {c: cells[name, column] for c, cells in found.items() if (name, column) in cells}
        )
        for name, column in sorted(keys, key=lambda key: order[key[0]])
    ]


def end_positions(errors: pd.DataFrame) -> list[EndPosition]:
    """Return a row per trajectory from what `pose_errors` returns."""
    medians = valid(errors).groupby(["trajectory", "condition"])[POSITION.column].median().to_dict()
    return [
        EndPosition(
            row.trajectory, {c: float(medians[row.trajectory, c]) for c in row.by_condition}, dict(row.by_condition)
        )
        for row in before_after(errors, (DISTANCE,))
    ]


def counts(rows: list[BeforeAfter]) -> dict[Bias, int]:
    """Return how many biases under ``corrected`` have each verdict."""
    verdicts = [row.corrected.verdict for row in rows if row.corrected is not None]
    return {verdict: verdicts.count(verdict) for verdict in Bias}


def root_mean_square_bias(rows: list[BeforeAfter], quantity: Quantity, condition: str) -> float:
    """Return the root mean square, over trajectories, of the biases under `condition`; NaN if there are none."""
    values = [
        row.by_condition[condition].bias for row in rows if row.quantity == quantity and condition in row.by_condition
    ]
    return float(np.sqrt(np.mean(np.square(values)))) if values else math.nan
