"""Model variants: the selected effects are refitted with other equations, and keep their names."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from agvbench.diagnosis.criteria import FIT, SELECTION, VARIANT
from agvbench.diagnosis.estimation.fit import fit_near
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate, applies, bounds_of, candidate, candidates
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.initial_steering import has_initial_steering, under_other_initial_steering
from agvbench.diagnosis.selection.stepwise import AnySelector, Selection, Selector
from agvbench.diagnosis.terms import TERMS
from agvbench.effects import Effect
from agvbench.effects.variants import Variant, cause_of, effect_variants
from agvbench.model import VehicleModel
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

_SAME_POSE = 1e-9

EXTENDED_LIBRARY: tuple[type[Effect], ...] = (*effect_variants().values(), *TERMS)
"""Variants and discrepancy terms: the extended library. One simulation contains all, because compiling is slow.

Hooks are called in this order: terms change what variants set, such as lags.
"""


def variant_candidates() -> dict[str, Candidate]:
    """Return the candidates of all variants, by name."""
    return {name: candidate(variant) for name, variant in effect_variants().items()}


def add_variants(selector: Selector, names: Collection[str]) -> None:
    """Add the variants among the `names` of effects to the candidates of a selector."""
    selector.candidates |= {name: one for name, one in variant_candidates().items() if name in names}


def simulated_variants(batch: Batch) -> list[type[Variant]]:
    """Return the variants that a batch simulates and that its vehicle can have."""
    return [v for v in effect_variants().values() if v in batch.kinds and applies(v, batch.geometry)]


def candidates_for(
    vehicle: VehicleModel | None, geometry: Geometry
) -> tuple[dict[str, Candidate], tuple[type[Effect], ...]]:
    """Return the candidates for a vehicle, and the effects outside the library that its simulation needs.

    A variant that the vehicle already has is a candidate in place of the effect of the library.
    """
    present = {effect.name for effect in (vehicle.effects if vehicle else ()) if not effect.is_null}
    variants = {name: one for name, one in variant_candidates().items() if name in present}
    known = {effect_variants()[name].variant_of for name in variants}
    return candidates(geometry, exclude=known) | variants, EXTENDED_LIBRARY if variants else ()


def with_extended_library(selector: AnySelector) -> AnySelector:
    """Return the selector of the same runs whose simulation includes discrepancy terms and variants.

    Every step of the selection gets the same one, so that no model is fitted twice.
    """
    names = selector.further_kinds
    library = EXTENDED_LIBRARY if names is None else tuple(kind for kind in EXTENDED_LIBRARY if kind.name in names)
    if {*library} <= {*selector.batch.kinds}:
        return selector
    if selector.extended is None:
        selector.extended = selector.for_batch(selector.batch.repacked(kinds=library))
    selector.extended.candidates = dict(selector.candidates)
    return selector.extended


@dataclass(frozen=True)
class _Replacement:
    """A variant that may replace the effect called ``replaced``, fitted from ``starts`` (n, p)."""

    replaced: str
    variant: type[Variant]
    starts: Floats


def select_variants(
    selection: Selection, selector: Selector, group: Collection[str] = (), among: Collection[str] | None = None
) -> Selection:
    """Return the selection with variants in place of effects of the library, where they predict better.

    An effect that only compensated for the wrong equation is removed. Models contain the names of variants; a diagnosis
    reports the effect that a variant belongs to. Effects with a cause in `group` are judged as in
    `Selector.backward_elimination`. Variants `among` these names are tried, all by default.
    """
    effects = [name for name in selection.chosen.names if name not in selector.given]
    if not effects:
        return selection
    extended, current = with_extended_library(selector), selection.chosen
    kinds = [kind for kind in simulated_variants(extended.batch) if among is None or kind.name in among]
    replacements = [one for name in effects for one in _replacements(selection, selector, extended, name, kinds)]
    tried: list[tuple[_Replacement, ScoredModel]] = []
    for name in effects:
        if name in current.names:
            own = [one for one in replacements if one.replaced == name and _is_new(one, current)]
            tried += _swapped_models(extended, current, own)
        current = _best_replacement(
            extended, current, [model for replacement, model in tried if replacement.replaced == name]
        )
    if current.names == selection.chosen.names:
        return selection
    current, gains = extended.backward_elimination(selection.base, current, group)
    gain = selection.chosen.deviance - current.deviance
    known = {name: selection.alternatives.get(cause_of(name), {}) for name in gains}
    alternatives = {name: _after_gain(known[name], gain) | _other_causes(current, name, tried) for name in gains}
    # An effect that a variant of another has replaced may be right beside a later discrepancy term.
    causes = {cause_of(n) for n in current.names}
    rejected = {n: g for n, g in (selection.rejected | selection.gains).items() if n not in causes}
    add_variants(selector, current.names)
    return Selection(selection.base, current, alternatives, gains, rejected, selector.models_fitted)


def continued(selection: Selection, before: Selection, selector: Selector) -> Selection:
    """Return the selection with further effects and variants, if it has variants or other effects than `before`.

    An effect that compensated for wrong actuators or a wrong equation hides others, which gain beside the right ones.
    """
    is_changed = {*selection.chosen.names} != {*before.chosen.names}
    if not is_changed and all(cause_of(name) == name for name in selection.chosen.names):
        return selection
    if not is_changed and not with_extended_library(selector).is_improvable(selection.chosen):
        return selection
    return select_further(selection, selection.chosen, selector)


def select_further(selection: Selection, begun: ScoredModel, selector: Selector) -> Selection:
    """Return the selection continued from a model that was `begun`, with further effects and variants."""
    extended = with_extended_library(selector)
    add_variants(extended, begun.names)
    again = extended.select(begun, map(cause_of, begun.names))
    again = select_variants(replace(again, base=selection.base), extended)
    selector.candidates |= {n: c for n, c in extended.candidates.items() if n in again.chosen.names}
    return replace(with_known_alternatives(again, selection), tried=selector.models_fitted)


def with_known_alternatives(again: Selection, before: Selection) -> Selection:
    """Return the selection `again` with the alternatives of its effects that were known `before` it was continued.

    They remain if they are no effects of it now, and predict as well after its further gain.
    """
    gain = before.chosen.deviance - again.chosen.deviance
    present = {cause_of(name) for name in again.chosen.names}
    kept = {name: _after_gain(before.alternatives.get(name, {}), gain) for name in again.gains}
    alternatives = {
        name: {other: more for other, more in known.items() if other not in present} | again.alternatives.get(name, {})
        for name, known in kept.items()
    }
    return replace(again, alternatives=alternatives)


def select_variants_and_reconsider(selection: Selection, selector: Selector) -> tuple[Selection, Selector]:
    """Select variants, and repeat the selection under the other initial steering if that is better now.

    With the wrong equation of a slow servo the wrong initial steering may fit better.
    """
    with_variants = select_variants(selection, selector)
    if with_variants is selection or not prefers_other_initial_steering(with_variants.chosen, selector):
        return with_variants, selector
    again, other = select_under_other_initial_steering(selector)
    return (again, other) if again.chosen.deviance < with_variants.chosen.deviance else (with_variants, selector)


def prefers_other_initial_steering(chosen: ScoredModel, selector: Selector) -> bool:
    """Return whether a model that depends on the initial steering predicts clearly better under the other one.

    Slow steering depends on it, and so does every term of what the steering did before.
    """
    if not has_initial_steering(selector):
        return False
    there = under_other_initial_steering(with_extended_library(selector))
    fitted = chosen.fit
    poses = Predictor(there.batch, chosen.names).predict(fitted.parameters)
    if np.allclose(poses, fitted.predictor.predict(fitted.parameters), rtol=0.0, atol=_SAME_POSE, equal_nan=True):
        return False
    other = there.refitted(chosen)
    return other is not None and other.deviance < chosen.deviance - SELECTION.min_gain


def select_under_other_initial_steering(selector: Selector) -> tuple[Selection, Selector]:
    """Repeat the selection under the other initial steering; return it with its selector."""
    other = under_other_initial_steering(selector)
    other.candidates = {n: c for n, c in other.candidates.items() if n not in effect_variants() or n in selector.given}
    return select_variants(other.select(), other), other


def starts_near(variant: type[Variant], model: ScoredModel) -> Floats:
    """Return starts (n, p) of a variant near the library's equation, with the parameters of `model`."""
    bounds = candidate(variant).bounds
    starts: Floats = np.clip(np.array(variant.starts(_values(model, variant.variant_of))), bounds[:, 0], bounds[:, 1])
    return starts


def _replacements(
    selection: Selection, selector: Selector, extended: Selector, name: str, kinds: Collection[type[Variant]]
) -> Iterator[_Replacement]:
    """Yield those `kinds` of variants of the effect `name`, and of others with at least half its gain in its place.

    The gain may be cross-validated, of the fit, or predicted.
    """
    chosen = selection.chosen
    without = selector.without_effect(selection.base, chosen, name)
    chosen_gains = without.deviance - chosen.deviance, chosen.fit_gain_over(without)
    tried = {kind.variant_of for kind in kinds}
    others = [other for other in selector.candidates if other not in chosen.names and other in tried]
    models = {name: chosen} | selector.likely(without, chosen, others)
    for variant in kinds:
        if variant.variant_of not in {name, *others}:
            continue
        kind = candidate(variant)
        if (model := models.get(variant.variant_of)) is not None and model.is_fitted:
            # A strong effect with the wrong equation fits well and predicts badly.
            gains = without.deviance - model.deviance, model.fit_gain_over(without)
            if any(own >= VARIANT.min_gain_share * gain for own, gain in zip(gains, chosen_gains, strict=True)):
                yield _Replacement(name, variant, starts_near(variant, model))
                continue
        # The library's equation may fail where a variant does not.
        larger = Predictor(extended.batch, (*without.names, variant.name))
        predicted_gains = [first_order_gain(without.fit, larger, start, kind.bounds) for start in kind.starts]
        if max(predicted_gains) >= VARIANT.min_gain_share * chosen_gains[1]:
            yield _Replacement(name, variant, kind.starts[[int(np.argmax(predicted_gains))]])


def _is_new(replacement: _Replacement, current: ScoredModel) -> bool:
    """Return whether no other effect of the model has the cause of the variant: a model has one equation per cause."""
    others = {cause_of(name) for name in current.names if name != replacement.replaced}
    return replacement.variant.variant_of not in others


def _values(model: ScoredModel, name: str) -> dict[str, float]:
    own = model.fit.effect_values()
    return {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] == name}


def _swapped_models(
    extended: Selector, current: ScoredModel, replacements: list[_Replacement]
) -> list[tuple[_Replacement, ScoredModel]]:
    """Return `current` with each variant in place of its effect; with the best ones also without one more effect.

    Another effect may only compensate for the wrong equation.
    """
    swapped: list[tuple[_Replacement, ScoredModel]] = []
    for one in replacements:
        with suppress(np.linalg.LinAlgError):  # the fit diverged
            swapped.append((one, substituted(extended, current, {one.replaced}, _variant_candidate(one))))
    least = min((model.deviance for _, model in swapped), default=math.inf)
    smaller = []
    for one, model in swapped:
        # A model with fewer effects fits no better: nothing is removed from one that fits much worse already.
        if model.fit_gain_over(current) < -VARIANT.max_fit_loss or model.deviance > least + extended.min_gain:
            continue
        present = {*current.names} - {one.replaced, *extended.given}
        most = extended.criteria.max_predicted_loss
        others = [name for name in current.names if name in present and _may_be_unnecessary(name, current, model, most)]
        with suppress(np.linalg.LinAlgError):
            smaller += [
                (one, substituted(extended, current, {one.replaced, other}, _variant_candidate(one)))
                for other in others
            ]
    return swapped + smaller


def _may_be_unnecessary(name: str, current: ScoredModel, model: ScoredModel, most: float) -> bool:
    """Return whether an effect is predicted to explain at `most` that beside a variant, or much less than before."""
    predicted, before = (one.fit.predicted_loss_without(name) for one in (model, current))
    return predicted < max(most, VARIANT.max_share_of_loss * before)


def _variant_candidate(replacement: _Replacement) -> Candidate:
    return replace(candidate(replacement.variant), starts=replacement.starts)


def _best_replacement(extended: Selector, current: ScoredModel, models: list[ScoredModel]) -> ScoredModel:
    """Return the best acceptable model, by deviance with a penalty for the number of effects."""
    acceptable = [model for model in models if _is_acceptable(model, current)]
    best = min((current, *acceptable), key=lambda model: model.deviance + SELECTION.min_gain * len(model.names))
    if best is current:
        return current
    extended.on_progress(f"{' + '.join(best.names)}: a variant gains {current.deviance - best.deviance:.0f}")
    return best


def _is_acceptable(model: ScoredModel, current: ScoredModel) -> bool:
    """Return whether a model gains over `current` or, with fewer effects, predicts about as well."""
    if len(model.names) < len(current.names):
        return model.deviance < current.deviance + SELECTION.min_gain
    return model.gain_over(current) > SELECTION.min_gain


def substituted(extended: Selector, current: ScoredModel, out: set[str], other: Candidate) -> ScoredModel:
    """Return `current` with another effect or a variant in place of the effects `out`, fitted from its parameters."""
    own = current.fit.effect_values()
    kept = [value for key, value in own.items() if key.partition(".")[0] not in out]
    names = (*(name for name in current.names if name not in out), other.name)
    starts = frozenset(start for start in current.starts if start[0] not in out) | other.key
    maps = current.fit.parameters[: extended.batch.maps.size]
    near = current.fit
    predictor, bounds = Predictor(extended.batch, names), bounds_of(names)
    fits = [
        fit_near(near, predictor, np.r_[maps, kept, start], bounds, iterations=FIT.few_steps) for start in other.starts
    ]
    best = min(fits, key=lambda one: one.total_loss)
    if best.total_loss - best.decrement > near.total_loss + VARIANT.max_fit_loss:
        return extended.unfinished(best, starts)  # further steps would not compensate for it
    return extended.score(names, best.parameters, best, starts=starts)


def _after_gain(known: dict[str, float], gain: float) -> dict[str, float]:
    """Return the `known` alternatives of an effect that remain after a further `gain` of the model."""
    return {
        other: difference + gain
        for other, difference in known.items()
        if difference + gain < SELECTION.alternative_margin
    }


def _other_causes(current: ScoredModel, name: str, tried: list[tuple[_Replacement, ScoredModel]]) -> dict[str, float]:
    """Return other effects that have a variant which predicts as well in the place of `name`."""
    others = {*current.names} - {name}
    return {
        replacement.variant.variant_of: model.deviance - current.deviance
        for replacement, model in tried
        if {*model.names} - {replacement.variant.name} == others
        and replacement.variant.variant_of != cause_of(name)
        and current.is_matched_by(model)
    }
