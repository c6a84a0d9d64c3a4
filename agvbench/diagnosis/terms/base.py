"""The base class of discrepancy terms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect


@dataclass(frozen=True)
class DiscrepancyTerm(Effect):
    """A shape without a cause: the residual depends on ``covariates``, and the shape acts ``through`` a channel."""

    relaxes: ClassVar[str] = "none: it stands for an unknown cause"
    reference: ClassVar[str] = "empirical"
    limits: ClassVar[str] = "describes, and explains nothing"
    covariates: ClassVar[tuple[str, ...]]
    through: ClassVar[str]
