"""One blind trial: the hidden effects, and the answer of the diagnosis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Trial:
    """One blind trial.

    Parameters
    ----------
    spec, seed
        Which plant it was.
    kind, hidden, library_names, covariates, absorbed, random_phase
        The sealed truth: its kind; the names hidden; those of the library that should be found; what an unexplained
        rest depends on; whether nodal maps absorb it; whether its phase is drawn anew for each run.
    true_parameters
        Of effects with the library's own equation: name to parameter to value.
    verdict, named, alternatives, depends_on
        The answer: the effects named, all the effects that may stand in for them, covariates of the rest in order.
    estimates
        Name to parameter to (value, standard error).
    squares_mm2
        Mean squared held-out position error: ``before``, ``after``, ``floor``.
    worse_on
        What the corrected model predicts worse.
    rivals
        Indistinguishable alternatives of the hidden effects of the library, where they were asked for.
    seconds
        What the diagnosis took.
    error
        Why there is no answer, where the bench or the diagnosis ended with an error.
    """

    spec: str
    seed: int
    kind: str
    hidden: tuple[str, ...]
    library_names: tuple[str, ...]
    covariates: tuple[str, ...]
    absorbed: bool
    random_phase: bool
    true_parameters: Mapping[str, Mapping[str, float]]
    verdict: str
    named: tuple[str, ...]
    alternatives: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    estimates: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    squares_mm2: Mapping[str, float] = field(default_factory=dict)
    worse_on: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    seconds: float = math.nan
    error: str = ""

    @property
    def outside(self) -> int:
        """How many effects from outside the library are hidden."""
        return len(self.hidden) - len(self.library_names)

    @property
    def false_names(self) -> tuple[str, ...]:
        """Names given that are neither the truth nor an indistinguishable alternative of it."""
        return tuple(name for name in self.named if name not in {*self.library_names, *self.rivals})

    @property
    def is_right(self) -> bool:
        """Whether every hidden effect was named, or listed as AMBIGUOUS with indistinguishable alternatives only."""
        if any(name not in {*self.library_names, *self.rivals} for name in (*self.named, *self.alternatives)):
            return False
        return set(self.library_names) <= {*self.named, *self.alternatives}

    @property
    def is_final(self) -> bool:
        """Whether the answer says that the effects named are all there is."""
        return self.verdict in {"NAMED", "AMBIGUOUS"}

    @property
    def answer(self) -> str:
        """The answer as one label."""
        return f"{self.verdict} {' + '.join(sorted(self.named))}".strip()

    @property
    def removed(self) -> float:
        """Share of the excess held-out squared error that the corrected model removes; NaN where there is none."""
        before, after, floor = (self.squares_mm2.get(name, math.nan) for name in ("before", "after", "floor"))
        return (before - after) / (before - floor) if before > 1.5 * floor else math.nan
