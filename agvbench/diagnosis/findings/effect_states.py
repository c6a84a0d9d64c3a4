"""The state of every effect of the library: present, absent with a bound, or not identifiable.

A selection states which effects a model needs, not how large the others may be. An effect that these runs cannot show
is another answer than one that they exclude, and decides whether a laboratory repairs something or drives other runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.findings.omitted_effects import OmittedEffect
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.result import Bound, EffectState, NamedEffect, State
from agvbench.diagnosis.selection.candidates import absorbed_by_maps, candidates
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import cause_of

_ABSORBED = "maps absorb it as calibration; it is named only where a nominal vehicle.toml lacks it"
_FLAT = "no run shows it: its standard error exceeds its usual size"
_NEVER_REACHED = "no run comes near a limit of this size"
_LIMIT_SIZES = np.geomspace(0.03, 3.0, 7)


def effect_states(
    chosen: Fit, effects: Iterable[NamedEffect], omitted: Mapping[str, OmittedEffect]
) -> dict[str, EffectState]:
    """Return the state of each effect of the library that applies to the vehicle, by name.

    Absent effects are the `omitted` ones, estimated beside the chosen model. The bound of a parameter is the far end of
    its 95 % interval. It holds for the chosen model: if structure remains in the residual, it holds as far as that
    structure does not resemble the effect.
    """
    named = {effect.name: effect for effect in effects}
    geometry = chosen.predictor.batch.geometry
    given = {cause_of(name) for name in chosen.predictor.effects}
    states = {name: EffectState(State.PRESENT) for name in (*named, *(given & effect_kinds().keys()))}
    kinds = {name: effect_kinds()[name] for name in candidates(geometry)}
    for name, kind in kinds.items():
        if name in states:
            continue
        replaced = tuple(sorted(effect.name for effect in named.values() if name in effect.confounded_with))
        if replaced:
            states[name] = EffectState(State.NOT_IDENTIFIABLE, indistinguishable_from=replaced)
        else:
            states[name] = _absent(kind, _bounds(chosen, kind, omitted.get(name)))
    absorbed = {
        name: EffectState(State.NOT_IDENTIFIABLE, why=_ABSORBED) for name in absorbed_by_maps(geometry) - states.keys()
    }
    return dict(sorted((states | absorbed).items()))


def _absent(kind: type[Effect], bounds: Mapping[str, Bound]) -> EffectState:
    if bounds:
        return EffectState(State.ABSENT, bounds)
    is_limit = any(math.isinf(p.null) for p in kind.parameters())
    return EffectState(State.NOT_IDENTIFIABLE, why=_NEVER_REACHED if is_limit else _FLAT)


def _bounds(chosen: Fit, kind: type[Effect], omitted: OmittedEffect | None) -> dict[str, Bound]:
    """Return the bound of each parameter that the runs determine, by name; a limit has no estimate."""
    if omitted is None:
        larger = Predictor(chosen.predictor.batch, (*chosen.predictor.effects, kind.name))
        return _bounds_of_limits(chosen, larger, kind)
    found = {}
    for k, p in enumerate(kind.parameters()):
        # The direction of an absent effect is unknown: the bound holds in every direction.
        if not p.is_direction and all(one.stderr[k] <= p.scale for one in omitted.estimates):
            most = max(float(one.sizes_from(omitted.nulls)[1][k]) for one in omitted.estimates)
            found[p.name] = Bound(most, p.unit)
    return found


def _bounds_of_limits(chosen: Fit, larger: Predictor, kind: type[Effect]) -> dict[str, Bound]:
    """Return the smallest limits that the runs leave possible: smaller ones would be predicted clearly worse."""
    scale = np.array([p.scale for p in kind.parameters()])
    excluded = 0.0
    for size in _LIMIT_SIZES:
        start = size * scale
        if first_order_gain(chosen, larger, start, np.column_stack([start, start])) > -SELECTION.alternative_margin:
            break
        excluded = float(size)
    return {p.name: Bound(excluded * p.scale, p.unit, is_limit=True) for p in kind.parameters()} if excluded else {}
