"""Other effects that explain the runs as well as a variant does: its further parameters may stand for them.

A variant with further parameters takes the place of several effects, and is preferred because it is one. Whether they
are the cause, or its parameters, the runs then do not tell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.levenberg_marquardt import FitState, LevenbergMarquardt
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.actuators import CAMERA, DELAY
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import with_extended_library
from agvbench.effects.variants import cause_of

_STANDARD_ERRORS = 3.0


def with_equal_descriptions(selection: Selection, before: ScoredModel, selector: Selector) -> Selection:
    """Return the selection with the effects that explain the runs as well as a variant, as its alternatives.

    `before` is the model without variants. Its effects that a variant made unnecessary are tried beside the library's
    equation; and what all delays of actuators have in common is moved to the camera.
    """
    variants = [n for n in selection.chosen.names if cause_of(n) != n and n not in selector.given]
    if not variants:
        return selection
    extended, present = with_extended_library(selector), {cause_of(name) for name in selection.chosen.names}
    removed = [name for name in before.names if cause_of(name) not in present]
    alternatives = dict(selection.alternatives)
    for name in variants:
        found = {other: _more_deviance(extended, selection, name, other) for other in removed}
        if cause_of(name) == DELAY and CAMERA in selector.candidates and CAMERA not in present:
            found[CAMERA] = _more_loss_of_camera(extended, selection.chosen, name)
        equal = {other: more for other, more in found.items() if more < SELECTION.alternative_margin}
        alternatives[name] = alternatives.get(name, {}) | equal
    return replace(selection, alternatives=alternatives)


def _more_deviance(extended: Selector, selection: Selection, variant: str, other: str) -> float:
    """Return by how much the deviance increases with the library's equation and `other` in place of a variant."""
    without = extended.without_effect(selection.base, selection.chosen, variant)
    with_library = extended.with_effect(without, cause_of(variant))
    if not with_library.is_fitted:
        return np.inf
    model = extended.with_effect(with_library, other)
    return model.deviance - selection.chosen.deviance


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
