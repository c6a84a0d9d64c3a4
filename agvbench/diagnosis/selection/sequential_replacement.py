"""Sequential replacement: selected effects against the others of the library, once the equations are known.

A stepwise selection compares effects beside the equations of the library. Beside better equations another effect may
explain what an effect was selected for; see Miller 2002, *Subset selection in regression*, section 3.3.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import SELECTION, VARIANT
from agvbench.diagnosis.selection.actuators import CAMERA
from agvbench.diagnosis.selection.candidates import default_candidate
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import ExcludedAlternative, Selection, Selector
from agvbench.diagnosis.selection.variants import add_variants, simulated_variants, substituted, with_extended_library
from agvbench.effects.variants import cause_of, causes_in

_MAX_ROUNDS = 3


def replace_sequentially(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with each effect replaced by another that predicts better, and with their alternatives."""
    extended, current = with_extended_library(selector), selection.chosen
    gains, alternatives = dict(selection.gains), dict(selection.alternatives)
    for _ in range(_MAX_ROUNDS):
        found = {name: _in_place_of(extended, selection.base, current, name) for name in gains}
        alternatives = {
            name: _kept(selection.alternatives.get(name, {}), others)
            | {
                cause_of(other): model.deviance - current.deviance
                for other, model in others.items()
                if current.is_matched_by(model)
            }
            for name, others in found.items()
        }
        # Actuators are preferred to a latency of the camera, even where they predict a little worse.
        models = [model for others in found.values() for other, model in others.items() if cause_of(other) != CAMERA]
        best = min(models, key=lambda model: model.deviance, default=current)
        if best.gain_over(current) < SELECTION.alternative_margin:
            break
        names = " + ".join(best.names)
        extended.on_progress(f"{names}: a replacement gains {current.deviance - best.deviance:.0f}")
        current, gains = extended.backward_elimination(selection.base, best, map(cause_of, best.names))
    current, gains = _with_library_equations(extended, selection.base, current, gains)
    by_cause = {cause_of(name): differences for name, differences in alternatives.items()}
    alternatives = {name: by_cause.get(cause_of(name), {}) for name in gains}
    add_variants(selector, current.names)
    rejected = {name: gain for name, gain in selection.rejected.items() if name not in current.names}
    tried = selector.models_fitted
    return replace(selection, chosen=current, gains=gains, alternatives=alternatives, rejected=rejected, tried=tried)


def _with_library_equations(
    extended: Selector, base: ScoredModel, current: ScoredModel, gains: dict[str, float]
) -> tuple[ScoredModel, dict[str, float]]:
    """Return the model with the library's equation in place of each variant that gains nothing over it, and the gains.

    Beside another effect a variant's further parameters may be unnecessary.
    """
    for name in [n for n in gains if cause_of(n) != n]:
        if name not in current.names:
            continue  # removed with another
        model = extended.with_effect(extended.without_effect(base, current, name), cause_of(name))
        if model.is_fitted and current.is_matched_by(model):
            current, gains = extended.backward_elimination(base, model, map(cause_of, model.names))
    return current, gains


def excluded_by_priors(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with the alternatives of each effect that predict as well, but contradict a prior.

    They are fitted without priors, so that a diagnosis states where a prior decided and not the campaign.
    """
    stated = {prior.effect for prior in selector.batch.readings.priors}
    if not stated:
        return selection
    extended, chosen = with_extended_library(selector), selection.chosen
    bare = extended.for_batch(extended.batch.with_priors(()))
    of_priors = chosen.fit.prior.of_effects
    excluded = {}
    for name in selection.gains:
        known = selection.alternatives.get(name, {})
        compared = {
            cause_of(other): (model, chosen.deviance - of_priors - model.deviance)
            for other, model in _without_priors(bare, chosen, name, stated).items()
            if model.is_fitted and cause_of(other) not in known
        }
        excluded[name] = {
            other: ExcludedAlternative(gain, model.fit)
            for other, (model, gain) in compared.items()
            if -max(gain, chosen.fit.total_loss - of_priors - model.fit.total_loss) < SELECTION.alternative_margin
        }
    return replace(selection, excluded={name: found for name, found in excluded.items() if found})


def _without_priors(bare: Selector, chosen: ScoredModel, name: str, stated: set[str]) -> dict[str, ScoredModel]:
    """Return the models with another effect in the place of `name`: each of the `stated` ones, and all if it is one.

    An effect that the model has already is fitted anew: its prior may be what makes the other one necessary. An effect
    that only its prior makes necessary is replaced by nothing.
    """
    base, cause = bare.base(), cause_of(name)
    without = bare.without_effect(base, chosen, name)
    is_needed = without.deviance > chosen.deviance - chosen.fit.prior.of_effects + SELECTION.alternative_margin
    models = _in_place_of(bare, base, chosen, name) if cause in stated and is_needed else {}
    for other in sorted((stated & bare.candidates.keys()) - {cause}):
        present = next((n for n in without.names if cause_of(n) == other), None)
        if present not in bare.given:
            rest = without if present is None else bare.without_effect(base, without, present)
            models[other] = bare.with_effect(rest, other)
    return models


def _kept(known: dict[str, float], others: dict[str, ScoredModel]) -> dict[str, float]:
    """Return the known alternatives that were not fitted again."""
    return {other: difference for other, difference in known.items() if other not in map(cause_of, others)}


def _in_place_of(extended: Selector, base: ScoredModel, current: ScoredModel, name: str) -> dict[str, ScoredModel]:
    """Return the models with another effect in the place of `name`, by that effect; unlikely ones are not fitted.

    A variant is not considered if the library's equations are predicted to gain too little to be near it.
    """
    without = extended.without_effect(base, current, name)
    causes = {cause_of(present) for present in current.names}
    gain = current.fit_gain_over(without)
    predicted = {other: extended.predicted_gain(without, other) for other in extended.further(current)}
    near = {cause_of(other) for other, own in predicted.items() if own >= SELECTION.likely_share * gain}
    variants = [v for v in simulated_variants(extended.batch) if v.variant_of not in causes and causes_in(v) & near]
    predicted |= {v.name: extended.predicted_gain(without, v.name) for v in variants}
    likely = VARIANT.min_gain_share * gain
    models = {other: extended.with_effect(without, other) for other in sorted(predicted) if predicted[other] >= likely}
    return {
        other: _from_current(extended, current, name, other, model) if model.fit_gain_over(without) >= likely else model
        for other, model in models.items()
        if model.is_fitted
    }


def _from_current(extended: Selector, current: ScoredModel, name: str, other: str, model: ScoredModel) -> ScoredModel:
    """Return the `model` with `other` in the place of `name`, or its fit from the parameters of `current`, if better.

    Without the effect `name`, delays and lags may have moved so far that a fit does not return from there.
    """
    if current.is_matched_by(model):
        return model
    near = replace(default_candidate(other), starts=model.values_of(other)[None])
    with suppress(np.linalg.LinAlgError):  # the fit diverged
        return min(model, substituted(extended, current, {name}, near), key=lambda one: one.deviance)
    return model
