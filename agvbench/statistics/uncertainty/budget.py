"""Uncertainty budgets after the GUM: components, combined and expanded uncertainty, coverage factor.

Source: JCGM 100:2008, *Guide to the expression of uncertainty in measurement*: type A evaluation 4.2, type B 4.3,
combination of uncorrelated inputs 5.1, effective degrees of freedom (Welch and Satterthwaite) equation G.2b.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from agvbench.statistics.intervals import CONFIDENCE

REPEATS = "repeats"
"""The source that is the scatter between repeats; without its size a budget has no interval."""


class Role(StrEnum):
    """What a component does in its budget."""

    COMBINED = "combined"
    IN_REPEATS = "in the scatter of repeats"
    """Varies from run to run, so that the type A component contains it already: adding it would count it twice."""
    NOT_STATED = "not stated"


@dataclass(frozen=True)
class Component:
    """One source of uncertainty.

    Parameters
    ----------
    source
        What is uncertain.
    evaluation
        ``A`` (by statistics of repeated observations) or ``B`` (by other means).
    distribution
        Behind the standard uncertainty.
    standard_uncertainty, unit
        Of the source; NaN where it is not stated.
    sensitivity
        Change of the result per change of the source, in the unit of the result per `unit`; a secant where it was
        computed with a finite step.
    degrees_of_freedom
        Infinite where the standard uncertainty counts as exactly known.
    role
        Whether it is combined.
    remark
        Where the number comes from, or how to state it.
    """

    source: str
    evaluation: str
    distribution: str
    standard_uncertainty: float
    unit: str
    sensitivity: float
    degrees_of_freedom: float
    role: Role = Role.COMBINED
    remark: str = ""

    @property
    def contribution(self) -> float:
        """The standard uncertainty of the result that the source causes, in the unit of the result."""
        return abs(self.sensitivity) * self.standard_uncertainty


@dataclass(frozen=True)
class Budget:
    """A result with the components of its uncertainty; `unit` is that of the result."""

    estimate: float
    unit: str
    components: Sequence[Component]

    @property
    def combined(self) -> float:
        """The combined standard uncertainty; NaN where no component is known."""
        parts = [c.contribution for c in self._combined]
        return math.hypot(*parts) if parts else math.nan

    @property
    def degrees_of_freedom(self) -> float:
        """The effective degrees of freedom after Welch and Satterthwaite; they are not rounded down."""
        spent = sum(c.contribution**4 / c.degrees_of_freedom for c in self._combined)
        return self.combined**4 / spent if spent > 0.0 else math.inf

    @property
    def coverage_factor(self) -> float:
        """The factor k for 95 %, from Student's t distribution with the effective degrees of freedom.

        It assumes that the result is nearly normal (JCGM 100:2008, G.6.5). NaN without repeats.
        """
        from scipy.special import ndtri, stdtrit

        if not self.is_repeated:
            return math.nan
        probability = 0.5 + CONFIDENCE / 2.0
        freedom = self.degrees_of_freedom
        return float(stdtrit(freedom, probability)) if math.isfinite(freedom) else float(ndtri(probability))

    @property
    def expanded(self) -> float:
        """The expanded uncertainty U = k·u for 95 %, in the unit of the result."""
        return self.coverage_factor * self.combined

    @property
    def is_repeated(self) -> bool:
        """Whether the scatter of repeats is known; without it the combined uncertainty is that of one run."""
        return not any(c.source == REPEATS and c.role is Role.NOT_STATED for c in self.components)

    @property
    def _combined(self) -> list[Component]:
        return [c for c in self.components if c.role is Role.COMBINED]
