"""Screening of discrepancy terms, by linear regression of residual rates on a grid of shapes.

Nonlinear parameters of a shape (a position, a radius, a time constant) come from the grid, linear ones from least
squares. Groups of runs that are left out decide on the rank of a shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import DISCREPANCY
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.discrepancy.command_history import CommandHistory
from agvbench.diagnosis.discrepancy.regression import FOLDS, GroupedRegression
from agvbench.diagnosis.discrepancy.shapes import Evidence, every_shape
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_REDUCED_SIZE = 0.1


@dataclass(frozen=True)
class Start:
    """A term with initial values (n, p) of a fit, and its ``gain``: the log likelihood ratio in runs left out.

    Every second row is the same shape at a tenth of its size. It is for cases in which the random effects of runs have
    absorbed the cause and release it in small steps only.
    """

    term: type[DiscrepancyTerm]
    values: Floats
    gain: float

    def beside(self, other: Start) -> Start:
        """Return the start with those initial values that gain at least about as much, this or another shape's."""
        best, worse = sorted((self, other), key=lambda start: -start.gain)
        near = worse.gain > DISCREPANCY.min_share_of_best_start * best.gain
        return replace(best, values=np.vstack([best.values, worse.values])) if near else best


def screen(
    rates: Rates, history: CommandHistory, geometry: Geometry, group: NDArray[np.int64], seed: int
) -> list[Start]:
    """Return the best start of each term with a predicted gain, the largest gain first.

    There is none where no step of a run is long enough for a rate.
    """
    if not len(rates.run):
        return []
    rear_axle_m = None if geometry.is_differential else geometry.rear_axle_m
    regression = GroupedRegression(rates, history, folds(group, FOLDS, seed)[rates.run], rear_axle_m)
    found: dict[type[DiscrepancyTerm], Start] = {}
    for term, shapes in every_shape(Evidence(rates, history, geometry, regression)):
        best: Start | None = None
        for columns, values in shapes:
            gain, coefficients = regression.gain(columns)
            if gain > (best.gain if best else 0.0):
                best = Start(
                    term, np.array([values(coefficients), values(_REDUCED_SIZE * coefficients)], dtype=np.float64), gain
                )
        if best is not None:
            found[term] = best if term not in found else found[term].beside(best)
    return sorted(found.values(), key=lambda start: -start.gain)
