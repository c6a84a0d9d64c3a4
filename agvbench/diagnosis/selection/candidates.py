"""Which effects are tried, from where, and between which bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from agvbench.diagnosis.terms import TERMS
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.model import VehicleModel
from agvbench.types import Floats

IN_THE_MAPS = frozenset({"steering_saturation", "drive_dead_band"})
"""What nodal maps describe by themselves: end stops and dead bands are read off the maps."""

_UNBOUNDED = 1e3
_STARTS = (0.1, 1.0)
_LIMIT_STARTS = (0.3, 1.0, 3.0)


@dataclass(frozen=True)
class Candidate:
    """An effect to try: its ``bounds`` (p, 2), ``scale`` (p,) of its parameters and ``starts`` (n, p) of fits.

    ``screened`` says that a regression chose the starts: one of them is near if there is anything to find. ``foremost``
    says that its predicted gain is larger than that of others: its fit is given all the steps that it takes.
    """

    name: str
    bounds: Floats
    scale: Floats
    starts: Floats
    screened: bool = False
    foremost: bool = False

    @property
    def key(self) -> frozenset[tuple[str, bytes]]:
        """What makes it another candidate than others of that name, to be compared."""
        return frozenset({(self.name, self.starts.tobytes() + bytes((self.screened, self.foremost)))})


def candidates(exclude: Iterable[str] = ()) -> dict[str, Candidate]:
    """Return every effect of the library that nodal maps do not describe anyway, by name."""
    out = {*exclude, *IN_THE_MAPS}
    return {name: candidate(kind) for name, kind in effect_kinds().items() if name not in out}


def candidate(kind: type[Effect]) -> Candidate:
    """Return how an effect is tried: from a tenth of its scale and from its scale, either sign where it has one."""
    parameters = kind.parameters()
    bounds = np.array([[max(p.low, -_UNBOUNDED), min(p.high, _UNBOUNDED)] for p in parameters])
    scale = np.array([p.scale for p in parameters])
    choices = []
    for p, s in zip(parameters, scale, strict=True):
        shares = _LIMIT_STARTS if math.isinf(p.null) else _STARTS
        signs = (1.0, -1.0) if p.low < p.null else (1.0,)
        choices.append([sign * share * s for share in shares for sign in signs])
    if len(parameters) == 1:
        starts = np.array(choices[0])[:, None]
    else:
        # Not every combination: all parameters small or all large, each with its own sign.
        starts = np.array([row for column in zip(*_by_share(choices), strict=True) for row in product(*column)])
    return Candidate(kind.name, bounds, scale, np.clip(starts, bounds[:, 0], bounds[:, 1]))


def _by_share(choices: list[list[float]]) -> list[list[list[float]]]:
    return [[[v for v in column if abs(v) == size] for size in sorted({abs(v) for v in column})] for column in choices]


def given_effects(vehicle: VehicleModel | None, tried: Iterable[str]) -> tuple[tuple[str, ...], Floats]:
    """Return names and parameters (p,) of the effects that a vehicle is known to have, of those that are `tried`."""
    known = {*tried}
    given = [e for e in (vehicle.effects if vehicle else ()) if e.name in known and not e.is_null]
    return tuple(e.name for e in given), np.array([value for e in given for value in e.values.values()])


@cache
def usual(name: str) -> Candidate:
    """Return how the effect called `name` is tried unless asked otherwise: of the library, another law, or a term."""
    kinds: dict[str, type[Effect]] = {**effect_kinds(), **effect_variants(), **{term.name: term for term in TERMS}}
    return candidate(kinds[name])


def bounds_of(names: Iterable[str]) -> Floats:
    """Return the bounds (p, 2) of all parameters of the effects called `names`."""
    return np.concatenate([np.empty((0, 2)), *(usual(name).bounds for name in names)])
