"""Other effects that explain the runs as well as a variant does: its further parameters may stand for them.

A variant with further parameters takes the place of several effects, and is preferred because it is one. Whether they
are the cause, or its parameters, the runs then do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.levenberg_marquardt import FitState, LevenbergMarquardt
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.actuators import CAMERA, DELAY
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import simulated_variants, with_extended_library
from agvbench.effects.variants import cause_of, causes_in, effect_variants

_STANDARD_ERRORS = 3.0
_LENGTHS, _MARKERS = ("wheelbase_error", "mocap_scale"), "marker_offset"
_TOLERANCE_M = 2e-3


def with_equal_descriptions(selection: Selection, before: ScoredModel, selector: Selector) -> Selection:
    """Return the selection with the effects that explain the runs as well as a variant, as its alternatives.

    `before` is the model without variants. Its effects that a variant made unnecessary are tried beside the library's
    equation. What all delays of actuators have in common is moved to the camera. A variant that combines several
    effects is also divided into two where it is only an alternative. Lengths that the vehicle or the camera may have
    wrong are compared with markers that are where they are known to be to 2 mm.
    """
    extended, present = with_extended_library(selector), {cause_of(name) for name in selection.chosen.names}
    removed = [name for name in before.names if cause_of(name) not in present]
    alternatives = dict(selection.alternatives)
    for name in selection.gains:
        found: dict[str, float] = {}
        if cause_of(name) != name:
            found = _divided(extended, selection, name, name, removed)
            if cause_of(name) == DELAY and CAMERA in selector.candidates and CAMERA not in present:
                found[CAMERA] = _more_loss_of_camera(extended, selection.chosen, name)
        known = alternatives.get(name, {})
        for variant in _combining_variants(extended, known):
            found |= _divided(extended, selection, name, variant, [])
        found |= _lengths_but_for_markers(extended, selection, name)
        equal = {other: more for other, more in found.items() if more < SELECTION.alternative_margin}
        alternatives[name] = known | equal
    return replace(selection, alternatives=alternatives)


def _lengths_but_for_markers(extended: Selector, selection: Selection, name: str) -> dict[str, float]:
    """Return by how much the deviance increases with a wrong scale of the camera for a wrong wheelbase, or vice versa.

    A scale also moves the markers, by a fraction of a millimetre. Their place is not known so well: the scale is
    compared beside an offset of the markers, unless that is too large to pass unnoticed.
    """
    present = {cause_of(one) for one in (*selection.chosen.names, *extended.given)}
    others = [one for one in _LENGTHS if one in extended.candidates and one not in present]
    if name not in _LENGTHS or not others or _MARKERS in present or _MARKERS not in extended.candidates:
        return {}
    chosen = selection.chosen
    model = extended.with_effect(extended.without_effect(selection.base, chosen, name), others[0])
    if not model.is_fitted:
        return {}
    model = extended.with_effect(model, _MARKERS)
    moved = [value for key, value in model.fit.effect_values().items() if key.startswith(f"{_MARKERS}.")]
    if not model.is_fitted or math.hypot(*moved) > _TOLERANCE_M:
        return {}
    return {others[0]: model.deviance - chosen.deviance}


def _combining_variants(extended: Selector, alternatives: Mapping[str, float]) -> list[str]:
    """Return the variants that combine one of the `alternatives` with another effect."""
    return [
        variant.name
        for variant in simulated_variants(extended.batch)
        if variant.variant_of in alternatives and len(causes_in(variant)) > 1
    ]


def _divided(extended: Selector, selection: Selection, name: str, variant: str, removed: list[str]) -> dict[str, float]:
    """Return by how much the deviance increases with two effects in the place of the selected one called `name`.

    The first is the library's equation of the `variant`. The second is one of the `removed` effects, and any likely one
    if the variant combines effects of the library.
    """
    chosen, library = selection.chosen, cause_of(variant)
    without = extended.without_effect(selection.base, chosen, name)
    with_library = extended.with_effect(without, library)
    # The library's equation may gain nothing alone, but beside the other effect.
    first = with_library if with_library.is_fitted else without
    models = {other: extended.with_effect(first, other) for other in removed}
    if len(causes_in(effect_variants()[variant])) > 1:
        present = {CAMERA, *map(cause_of, chosen.names), library, *removed}
        models |= extended.likely(first, chosen, [n for n in extended.candidates if cause_of(n) not in present])
    models = {other: model for other, model in models.items() if model.is_fitted}
    if first is without:
        models = {other: extended.with_effect(model, library) for other, model in models.items()}
    return {other: model.deviance - chosen.deviance for other, model in models.items()}


def _more_loss_of_camera(extended: Selector, chosen: ScoredModel, delays: str) -> float:
    """Return by how much the loss increases if the camera is late by what the `delays` have in common, and they less.

    Runs that begin at rest do not distinguish the two: nothing is fitted, and one evaluation tells.
    """
    names, own = (*chosen.names, CAMERA), chosen.fit
    of_delays = np.array([key.partition(".")[0] == delays for key in own.predictor.parameter_names])
    at = extended.batch.maps.size + np.flatnonzero(of_delays)
    least = at[np.argmin(own.parameters[at])]
    common = own.parameters[least]
    if common < _STANDARD_ERRORS * np.sqrt(own.covariance[least, least]):
        return np.inf  # the delays have nothing in common
    parameters = np.r_[own.parameters, common]
    parameters[at] -= common
    solver = LevenbergMarquardt(Predictor(extended.batch, names), bounds_of(names))
    state = FitState(parameters, own.random_effects, own.variance_components)
    try:
        return solver.evaluate(state, own.linear).loss - own.total_loss
    except np.linalg.LinAlgError:
        return np.inf
