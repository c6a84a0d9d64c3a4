"""Delays of the camera against delays of the actuators: a model of all actuators in place of a latency of the camera.

Servos and drive follow a command late, each in its own way. A latency of the camera with a filter resembles all of them
at once, so that a selection of one effect at a time takes the filter. It is a claim about a documented instrument, and
is kept only if the actuators do not explain the runs as well.
"""

from __future__ import annotations

from dataclasses import replace

from agvbench.diagnosis.criteria import DISCREPANCY, SELECTION
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.residuals.covariate_test import dependences
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import variant_candidates, with_extended_library
from agvbench.effects.variants import cause_of

CAMERA = "mocap_latency"
ACTUATORS = ("actuation_delay", "steering_lag", "speed_lag")


def prefer_actuators(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with actuators in place of a latency of the camera, if they predict about as well.

    If the residuals show structure, both models are wrong, and a likelihood ratio does not discriminate them: the
    actuators are preferred if they keep most of the gain. The latency is then an alternative of each actuator that
    replaced it.
    """
    chosen = selection.chosen
    camera = next((n for n in chosen.names if cause_of(n) == CAMERA and n not in selector.given), None)
    if camera is None:
        return selection
    extended = with_extended_library(selector)
    without = extended.without_effect(selection.base, chosen, camera)
    every = _with_actuators(extended, without)
    difference, gain = every.deviance - chosen.deviance, without.deviance - chosen.deviance
    margin = SELECTION.alternative_margin
    if difference > (max(margin, SELECTION.camera_share * gain) if _has_structure(chosen, selector.seed) else margin):
        return selection
    current, gains = extended.backward_elimination(selection.base, every, ACTUATORS)
    selector.on_progress(f"{' + '.join(current.names)}: actuators in place of {CAMERA} gain {-difference:.0f}")
    causes = {cause_of(name) for name in current.names} | {CAMERA}
    alternatives = {
        name: {other: more for other, more in selection.alternatives.get(name, {}).items() if other not in causes}
        for name in gains
    }
    for name in gains:
        if difference > -margin and name not in chosen.names and cause_of(name) in ACTUATORS:
            alternatives[name][CAMERA] = -difference
    selector.candidates |= {n: c for n, c in variant_candidates().items() if n in current.names}
    rejected = {name: gain for name, gain in selection.rejected.items() if name not in causes}
    return replace(
        selection,
        chosen=current,
        alternatives=alternatives,
        gains=gains,
        rejected=rejected,
        tried=selection.tried + extended.tried,
    )


def _has_structure(model: ScoredModel, seed: int) -> bool:
    """Return whether the residuals in the training runs show lack of fit, or depend on a covariate."""
    if has_lack_of_fit(model):
        return True
    readings = model.fit.predictor.readings
    rates = residual_rates(readings, model.fit.predictor.predict(model.fit.parameters))
    return bool(dependences(rates, readings.group, seed, readings.start))


def _with_actuators(extended: Selector, current: ScoredModel) -> ScoredModel:
    """Return the model with every actuator, and with the effects that meet the criterion beside them."""
    for name in ACTUATORS:
        if name not in {cause_of(present) for present in current.names}:
            larger = extended.with_effect(current, name)
            current = larger if larger.is_fitted else current
    while True:
        causes = {cause_of(name) for name in current.names} | {CAMERA}
        names = [name for name in extended.candidates if name not in causes and name not in variant_candidates()]
        predicted = {name: extended.predicted_gain(current, name) for name in names}
        best = sorted(predicted, key=lambda name: -predicted[name])[: DISCREPANCY.max_refitted]
        models = [extended.with_effect(current, name) for name in best if predicted[name] > extended.min_gain]
        accepted = [model for model in models if extended.meets_criterion(current, model)]
        if not accepted:
            return current
        current = min(accepted, key=lambda model: model.deviance)
