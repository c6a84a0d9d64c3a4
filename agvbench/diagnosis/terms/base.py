"""The base class of discrepancy terms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from agvbench.effects.base import Effect, parameter
from agvbench.model.compiled import compiled


@dataclass(frozen=True)
class DiscrepancyTerm(Effect):
    """A shape without a cause: the residual depends on ``covariates``, and the shape acts ``through`` a channel.

    ``form_of`` are effects of the library of which the term is another form: where one was selected, the term is tried
    in its place, even if no residual is left. ``distinguished_by`` are the runs that tell them apart. ``for_windows``
    says whether a window of free driving can have the term: not if it depends on the beginning or the end of a run, or
    on the time since the campaign began.
    """

    relaxes: ClassVar[str] = "none: it stands for an unknown cause"
    reference: ClassVar[str] = "empirical"
    limits: ClassVar[str] = "describes, and explains nothing"
    covariates: ClassVar[tuple[str, ...]]
    through: ClassVar[str]
    form_of: ClassVar[frozenset[str]] = frozenset()
    distinguished_by: ClassVar[str] = ""
    for_windows: ClassVar[bool] = True


def coordinate() -> Any:
    """Declare a coordinate on the floor, or a distance from its origin."""
    return parameter(unit="m", low=-50.0, high=50.0, scale=0.5)


@compiled(inline=True)
def decayed(value: float, since_s: float, time_constant_s: float) -> float:
    """Return what is left of a value that decays exponentially, `since_s` seconds later; all of it before that."""
    return value * math.exp(-max(since_s, 0.0) / time_constant_s)
