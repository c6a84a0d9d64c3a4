"""Before and after, trajectory by trajectory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.statistics.equivalence import Bias, Equivalence, equivalences
from agvbench.statistics.quantities import QUANTITIES, Quantity
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


def before_after(errors: pd.DataFrame) -> list[BeforeAfter]:
    """Return a row per trajectory and quantity from what `pose_errors` returns."""
    found = {condition: equivalences(errors, condition) for condition in CONDITIONS}
    keys = dict.fromkeys(key for cells in found.values() for key in cells)
    quantities = {quantity.column: quantity for quantity in QUANTITIES}
    order = {name: i for i, name in enumerate(dict.fromkeys(errors["trajectory"]))}
    return [
        BeforeAfter(
            name, quantities[column], {c: cells[name, column] for c, cells in found.items() if (name, column) in cells}
        )
        for name, column in sorted(keys, key=lambda key: order[key[0]])
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
