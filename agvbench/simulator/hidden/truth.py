"""What a hidden plant keeps sealed: what it hides, how large, and how visible that is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["nothing", "library", "other form", "outside", "two"]


@dataclass(frozen=True)
class Change:
    """When constants of a plant hold: a share of their full values by the time since the session began.

    Parameters
    ----------
    constants
        The constants by name; their null is 0.
    begins_h, ends_h
        Between these times they hold, and otherwise not [h].
    time_constant_h
        They approach their full values exponentially; 0 is a step [h].
    """

    constants: tuple[str, ...]
    begins_h: float = 0.0
    ends_h: float = math.inf
    time_constant_h: float = 0.0

    def share(self, hours: float) -> float:
        """Return the share of the full values at a time [h]."""
        if not self.begins_h <= hours < self.ends_h:
            return 0.0
        return 1.0 - math.exp((self.begins_h - hours) / self.time_constant_h) if self.time_constant_h else 1.0


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden effect.

    Parameters
    ----------
    name
        Its name here: ``"steering_lag"``, ``"steering_lag_second_order"``, ``"slow_patch"``.
    library_name
        The library's effect that should be named; None for what lies outside the library.
    kind
        ``"library"``: the library's equation; ``"other form"``: the same cause with another order or form;
        ``"outside"``: a cause that the library does not have.
    parameters
        In the library's names and units where the equation is the library's, else the mechanism's own.
    covariates
        What an unexplained residual depends on, the best answers first; empty inside the library.
    random_phase
        Whether its phase differs from run to run, so that no open-loop model can remove it.
    """

    name: str
    library_name: str | None
    kind: Kind
    parameters: Mapping[str, float]
    covariates: tuple[str, ...] = ()
    random_phase: bool = False


@dataclass(frozen=True)
class SealedTruth:
    """What is hidden in a plant; read it for scoring only.

    Parameters
    ----------
    kind
        ``"nothing"``, the single effect's kind, or ``"two"``.
    effects
        What is hidden.
    separation
        Rms distance [floors] by which the effects move the reference drives when the static maps are refitted;
        NaN where nothing is hidden.
    separation_unfitted
        The same when the maps are held.
    floor_m
        Rms run-to-run variation of the reference drives with the camera's noise [m].
    absorbed
        Whether nodal static maps absorb the effect by construction: it shows only against maps known otherwise.
    """

    kind: Kind
    effects: tuple[HiddenEffect, ...] = ()
    separation: float = float("nan")
    separation_unfitted: float = float("nan")
    floor_m: float = float("nan")
    absorbed: bool = False
    constants: Mapping[str, float] = field(default_factory=dict)
    """All constants of the plant by name, base and mechanisms, at their full values."""
    changes: tuple[Change, ...] = ()
    """When constants hold that do not always hold."""

    @property
    def library_names(self) -> tuple[str, ...]:
        """The library's names that a diagnosis should find."""
        return tuple(effect.library_name for effect in self.effects if effect.library_name is not None)
