"""What an empirical term is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect


@dataclass(frozen=True)
class DiscrepancyTerm(Effect):
    """A shape without a cause: ``covariates`` says on what the residual depends, ``through`` what it acts."""

    relaxes: ClassVar[str] = "none: it stands for an unknown cause"
    reference: ClassVar[str] = "empirical"
    limits: ClassVar[str] = "describes, and explains nothing"
    covariates: ClassVar[tuple[str, ...]]
    through: ClassVar[str]
