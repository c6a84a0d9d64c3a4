"""Shapes of discrepancy terms: what a term changes in the residual rates, for nonlinear parameters from a grid."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from agvbench.diagnosis.discrepancy.command_history import CommandHistory
from agvbench.diagnosis.discrepancy.regression import Columns, GroupedRegression
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

Option = tuple[Columns, Callable[[Floats], list[float]]]
"""Regressors of a shape, and the function that composes the term's parameters from their coefficients."""

Shapes = Iterator[tuple[type[DiscrepancyTerm], Iterator[Option]]]


RUN_TIMES_S = (0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
"""Time constants of what decays since the start of a run."""


@dataclass(frozen=True)
class Evidence:
    """The residual rates, what was commanded before each, the axles' positions, and the regression of the rates."""

    rates: Rates
    history: CommandHistory
    geometry: Geometry
    regression: GroupedRegression


class Values:
    """Composes a term's parameters from regression coefficients and grid values, in the term's order."""

    def __init__(self, *fixed: float) -> None:
        self.fixed = fixed

    def __call__(self, coefficients: Floats) -> list[float]:
        """Return the parameters: coefficients, then grid values."""
        return [*coefficients.tolist(), *self.fixed]
