"""Candidate effects, with the bounds and initial values of their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from agvbench.diagnosis.terms import TERMS
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.base import Parameter
from agvbench.effects.variants import cause_of, effect_variants
from agvbench.model import VehicleModel
from agvbench.model.priors import is_limit
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

ABSORBED_BY_MAPS = frozenset({"steering_saturation", "drive_dead_band"})
"""Effects that nodal maps absorb: end stops and dead bands are read off the fitted maps."""

_UNBOUNDED = 1e3
_STARTS = (0.1, 1.0)
_NEAR_NULL = 1e-3
_LIMIT_STARTS = (0.3, 1.0, 3.0)
DIRECTIONS = (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi)
"""Initial values of a direction [rad]: a fit does not turn by more than a quarter of a turn."""


@dataclass(frozen=True)
class Candidate:
    """A candidate effect: ``bounds`` (p, 2), ``scale`` (p,) of its parameters, and ``starts`` (n, p) of fits.

    ``screened`` is True if a regression determined the starts: then one of them is close if the effect is present.
    ``expected_gain`` is the gain that this regression predicts: random effects that have absorbed a cause hide it from
    the derivatives. ``patient`` is True if its predicted gain is the largest of all: its fit is then iterated to
    convergence.
    """

    name: str
    bounds: Floats
    scale: Floats
    starts: Floats
    screened: bool = False
    patient: bool = False
    expected_gain: float = 0.0

    @property
    def key(self) -> frozenset[tuple[str, bytes]]:
        """The key that distinguishes this candidate from others with the same name."""
        how = np.array([self.screened, self.patient, self.expected_gain]).tobytes()
        return frozenset({(self.name, self.starts.tobytes() + how)})


def candidates(geometry: Geometry, exclude: Iterable[str] = ()) -> dict[str, Candidate]:
    """Return every effect of the library, by name, except those that nodal maps absorb and those in `exclude`.

    Effects of two driven axles are no candidates if one is driven, and those of axle angles if none is steered.
    """
    excluded = {*exclude, *absorbed_by_maps(geometry)}
    return {
        name: candidate(kind)
        for name, kind in effect_kinds().items()
        if name not in excluded and applies(kind, geometry)
    }


def absorbed_by_maps(geometry: Geometry) -> frozenset[str]:
    """Return the effects that nodal maps absorb.

    The speed map of a differential vehicle absorbs the camera's scale, but for the lever arm of the markers, which
    `marker_offset` moves as well.
    """
    return ABSORBED_BY_MAPS | ({"mocap_scale"} if geometry.is_differential else frozenset())


def applies(kind: type[Effect], geometry: Geometry) -> bool:
    """Return whether a vehicle of this geometry can have an effect."""
    if kind.needs_steered_axles if geometry.is_differential else kind.needs_differential:
        return False
    return geometry.driven == "both" or not kind.needs_both_axles_driven


def candidate(kind: type[Effect]) -> Candidate:
    """Return the candidate of an effect: initial values are near its null values and at its scale, with each sign.

    Maps absorb much of most effects. What they leave shows only where the derivatives by the effect and by the maps are
    taken at the same point, that is near the null values; a strong effect may need a start at its scale. Variants and
    discrepancy terms, whose parameters also shape them, start at 0.1 and 1 times their scale.
    A direction has four initial values: a fit does not turn by more than a quarter of a turn.
    """
    parameters = kind.parameters()
    bounds = np.array([[max(p.low, -_UNBOUNDED), min(p.high, _UNBOUNDED)] for p in parameters])
    scale = np.array([p.scale for p in parameters])
    near_null = kind.name in effect_kinds()
    choices = [_choices(p, near_null=near_null) for p in parameters]
    if len(parameters) == 1:
        starts = np.array(choices[0])[:, None]
    else:
        # Not all combinations: either all parameters are small or all are large, with all signs.
        starts = np.array([row for column in zip(*_by_share(choices), strict=True) for row in product(*column)])
    for k, p in enumerate(parameters):
        if p.is_direction:
            starts = np.repeat(starts, len(DIRECTIONS), axis=0)
            starts[:, k] = np.tile(DIRECTIONS, len(starts) // len(DIRECTIONS))
    within = dict.fromkeys(map(tuple, np.clip(starts, bounds[:, 0], bounds[:, 1]).tolist()))
    return Candidate(kind.name, bounds, scale, np.array([*within]))


def _choices(p: Parameter, *, near_null: bool) -> list[float]:
    """Return the initial values of one parameter, ascending in size."""
    if p.is_direction:
        return [0.0]
    if math.isinf(p.null):
        return [share * p.scale for share in _LIMIT_STARTS]
    signs = (1.0, -1.0) if p.low < p.null else (1.0,)
    if near_null:
        return [_NEAR_NULL * p.scale, *(sign * p.scale for sign in signs)]
    return [sign * share * p.scale for share in _STARTS for sign in signs]


def _by_share(choices: list[list[float]]) -> list[list[list[float]]]:
    """Return the initial values of each parameter by size; a parameter with fewer sizes repeats its largest."""
    by_size = [
        [[v for v in column if abs(v) == size] for size in sorted({abs(v) for v in column})] for column in choices
    ]
    most = max(len(sizes) for sizes in by_size)
    return [sizes + sizes[-1:] * (most - len(sizes)) for sizes in by_size]


def given_effects(vehicle: VehicleModel | None, tried: Iterable[str]) -> tuple[tuple[str, ...], Floats]:
    """Return names and parameters (p,) of the effects that a vehicle is known to have, restricted to `tried`."""
    known, effects, priors = {*tried}, vehicle.effects if vehicle else (), vehicle.priors if vehicle else ()
    # A null effect with a prior is a quantity that was measured, and may deviate by its error.
    measured = {prior.effect for prior in priors if not is_limit(prior)}
    given = [e for e in effects if e.name in known and not (e.is_null and cause_of(e.name) not in measured)]
    names, values = tuple(e.name for e in given), np.array([value for e in given for value in e.values.values()])
    # A limit that is left out is infinite: no step of a fit begins there.
    return names, np.clip(values, *bounds_of(names).T)


@cache
def default_candidate(name: str) -> Candidate:
    """Return the default candidate of an effect of the library, a variant or a discrepancy term."""
    kinds: dict[str, type[Effect]] = {**effect_kinds(), **effect_variants(), **{term.name: term for term in TERMS}}
    return candidate(kinds[name])


def bounds_of(names: Iterable[str]) -> Floats:
    """Return the bounds (p, 2) of all parameters of the effects called `names`."""
    return np.concatenate([np.empty((0, 2)), *(default_candidate(name).bounds for name in names)])
