"""Selection of a discrepancy term for a cause outside the library, and of the effects beside it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.criteria import DISCREPANCY, FIT, SELECTION
from agvbench.diagnosis.discrepancy.best_term import (
    best_term,
    is_constant_change,
    screened_terms,
    terms_without_regression,
)
from agvbench.diagnosis.discrepancy.campaign_time import complement
from agvbench.diagnosis.discrepancy.other_forms import models_of_other_forms, with_other_forms
from agvbench.diagnosis.selection.actuators import CAMERA, prefer_actuators, separate_lag_from_delay
from agvbench.diagnosis.selection.candidates import candidate
from agvbench.diagnosis.selection.equal_descriptions import with_equal_descriptions
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.sequential_replacement import replace_sequentially
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import (
    prefers_other_initial_steering,
    select_under_other_initial_steering,
    with_extended_library,
)
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms import TERMS, DiscrepancyTerm
from agvbench.diagnosis.terms.campaign_time import ByCampaignTime
from agvbench.effects.variants import cause_of

ModelWithTerm = tuple[ScoredModel, type[DiscrepancyTerm], dict[str, float]]
"""A model with a term, the term, and the gains of the effects beside it."""

TERM_NAMES = frozenset(term.name for term in TERMS)


def reselect_effects(
    extended: Selector, selection: Selection, current: ScoredModel, term: type[DiscrepancyTerm]
) -> ModelWithTerm:
    """Return the model with the term and the effects that meet the criterion beside it, and their gains.

    An effect that was selected without the term may only mimic one that is right beside it.
    """
    base = selection.base
    current = add_masked_effects(extended, current)
    names = [n for n in selection.chosen.names if n not in current.names]
    names += sorted(selection.rejected, key=lambda n: -selection.rejected[n])[: DISCREPANCY.max_refitted]
    for name in names:
        larger = extended.with_effect(current, name)
        if name not in current.names and extended.meets_criterion(current, larger):
            current = larger
    while True:
        found = [n for n in current.names if n not in {*base.names, term.name}]
        smaller = {name: extended.refitted_without(base, current, name) for name in found}
        gains = {name: model.deviance - current.deviance for name, model in smaller.items()}
        unnecessary = [name for name, model in smaller.items() if not extended.meets_criterion(model, current)]
        if not unnecessary:
            simpler = _with_complement(extended, base, current, term)
            if simpler is None:
                return current, term, gains
            current = simpler
            continue
        current = smaller[min(unnecessary, key=lambda name: gains[name])]


def _with_complement(
    extended: Selector, base: ScoredModel, current: ScoredModel, term: type[DiscrepancyTerm]
) -> ScoredModel | None:
    """Return the model with the opposite change in the rest of the campaign, if that needs an effect less.

    Markers that are displaced from a bump on are markers that are always displaced but not before the bump.
    """
    if not issubclass(term, ByCampaignTime):
        return None
    opposite = complement(current.values_of(term.name), extended.batch.readings.started_h)
    if opposite is None:
        return None
    kind = replace(candidate(term), starts=opposite[None], screened=True, patient=True)
    without_term = extended.without_effect(base, current, term.name)
    for name in (n for n in current.names if n not in {*base.names, term.name}):
        model = extended.with_effect(extended.without_effect(base, without_term, name), term.name, kind)
        if model.is_fitted and model.deviance < current.deviance + extended.min_gain:
            return model
    return None


def add_masked_effects(extended: Selector, current: ScoredModel) -> ScoredModel:
    """Add effects that the unknown cause masked, as long as the residuals show lack of fit or one is likely.

    An effect without a gain beside the first selection may become significant once the term is in the model. The gain
    of each effect is predicted, and only the best are fitted. A lack of fit alone would not do: its test allows for the
    differences between repeats, and these hide an effect that acts on few groups.
    """
    while True:
        names = [name for name in extended.candidates if name not in current.names and name not in TERM_NAMES]
        predicted_gains = {name: extended.predicted_gain(current, name) for name in names}
        best = sorted(predicted_gains, key=lambda name: -predicted_gains[name])[: DISCREPANCY.max_refitted]
        is_likely = predicted_gains[best[0]] > FIT.large_predicted_gain if best else False
        if not is_likely and not has_lack_of_fit(current):
            break
        models = [extended.with_effect(current, name) for name in best if predicted_gains[name] > extended.min_gain]
        accepted = [model for model in models if extended.meets_criterion(current, model)]
        if not accepted:
            break
        current = min(accepted, key=lambda model: model.deviance)
    return current


def add_term(selection: Selection, selector: Selector) -> TermSelection | None:
    """Return the best discrepancy term with the effects that meet the criterion beside it; None if no term does.

    Terms are fitted beside the selected effects. If none helps there, they are fitted without any effect: an effect
    that only mimics the unknown cause is removed once the term is in the model. If the predicted gain is larger without
    the effects, that is done first, and the effects are then fitted again beside the term. A term that is another form
    of a selected effect is fitted in its place in any case.

    Parameters
    ----------
    selection
        The selection from the library.
    selector
        Its selector.
    """
    extended = with_extended_library(selector)
    starts = screened_terms(extended, selection.chosen)
    found: list[tuple[ScoredModel, type[DiscrepancyTerm]] | None] = []
    if starts or has_lack_of_fit(selection.chosen):
        starts_alone = screened_terms(extended, selection.base) if selection.gains else []
        is_better_alone = bool(starts_alone) and starts_alone[0].gain > max(
            (start.gain for start in starts), default=0.0
        )
        first = best_term(extended, selection.base, starts_alone) if is_better_alone else None
        if first is not None and first[0].deviance < selection.chosen.deviance:
            found.append(first)
            if starts and starts[0].gain > DISCREPANCY.min_share_of_best_start * starts_alone[0].gain:
                found.append(best_term(extended, selection.chosen, starts))
        else:
            found.append(best_term(extended, selection.chosen, starts))
            if found[0] is None and selection.gains:
                alone = first or best_term(extended, selection.base, starts_alone)
                found += [
                    alone if alone is not None and _may_be_mimicked(selection, alone[0]) else None,
                    _term_in_place_of_effect(extended, selection, selection.gains),
                ]
    else:
        found.append(_term_in_place_of_effect(extended, selection, selection.gains))
    others = models_of_other_forms(extended, selection)
    found += [(model, term) for _, term, model in others if model.deviance < selection.chosen.deviance]
    models = [reselect_effects(extended, selection, *pair) for pair in found if pair is not None]
    models = [_with_other_change(extended, selection, model) for model in models]
    return _best_with_term(extended, selection, selector, models)


def _with_other_change(extended: Selector, selection: Selection, model: ModelWithTerm) -> ModelWithTerm:
    """Return the model with another change with time in the place of its own, if that predicts better.

    While effects were missing, another quantity or course had the least error; its fit may end in another minimum.
    """
    chosen, own, _ = model
    if not issubclass(own, ByCampaignTime):
        return model
    without = extended.without_effect(selection.base, chosen, own.name)
    best: ScoredModel = chosen
    term: type[DiscrepancyTerm] = own
    for start in screened_terms(extended, without):
        kind = replace(candidate(start.term), screened=True, patient=True)
        shapes = np.clip(start.values, kind.bounds[:, 0], kind.bounds[:, 1]).reshape(-1, 2, len(kind.bounds))
        for sizes in shapes if issubclass(start.term, ByCampaignTime) else ():
            other = extended.with_effect(without, start.term.name, replace(kind, starts=sizes))
            if other.is_fitted and other.deviance < best.deviance and not is_constant_change(other, start.term):
                best, term = other, start.term
    if best.gain_over(chosen) < SELECTION.alternative_margin:
        return model
    return reselect_effects(extended, selection, best, term)


def _with_right_actuators(extended: Selector, selection: Selection, model: ModelWithTerm) -> ModelWithTerm:
    """Return the model with other actuators and the effects beside them, if they explain a slow response better.

    While the term was missing, its cause decided which actuators fitted best. Actuators that explain the runs as well
    replace a latency of the camera, as they do without a term.
    """
    chosen, term, gains = model
    beside = Selection(selection.base, chosen, {}, gains, {}, extended.models_fitted)
    right = separate_lag_from_delay(prefer_actuators(beside, extended), extended).chosen
    if {*right.names} == {*chosen.names} or term.name not in right.names:
        return model
    again = reselect_effects(extended, selection, right, term)
    before, after = ({cause_of(name) for name in one.names} for one in (chosen, again[0]))
    margin = SELECTION.alternative_margin if CAMERA in before - after else 0.0
    return again if again[0].deviance < chosen.deviance + margin else model


def _with_replacements(extended: Selector, selection: Selection, model: ModelWithTerm) -> Selection:
    """Return the model with each effect replaced by another that predicts better beside the term, and the alternatives.

    While the term was missing, its cause decided which effects were compared.
    """
    chosen, term, gains = model
    beside = replace(selection, chosen=chosen, gains=gains, alternatives={})
    replaced = replace_sequentially(beside, extended) if gains else beside
    replaced = replaced if term.name in replaced.chosen.names else beside
    gains = {name: gain for name, gain in replaced.gains.items() if name != term.name}
    known = extended.alternatives(selection.base, replaced.chosen, selection.alternatives)
    alternatives = {name: known.get(name, {}) | replaced.alternatives.get(name, {}) for name in gains}
    replaced = replace(replaced, gains=gains, alternatives=alternatives)
    return with_equal_descriptions(replaced, selection.chosen, extended)


def _best_with_term(
    extended: Selector, selection: Selection, selector: Selector, models: list[ModelWithTerm]
) -> TermSelection | None:
    """Return the best of the models with a term, if the term meets the criterion."""
    models = [model for model in models if model[0].deviance < selection.chosen.deviance - selector.min_gain]
    if not models:
        return None
    best = _with_right_actuators(extended, selection, min(models, key=lambda model: model[0].deviance))
    replaced, term = _with_replacements(extended, selection, best), best[1]
    chosen = replaced.chosen
    without = extended.without_effect(selection.base, chosen, term.name)
    if not extended.meets_criterion(without, chosen):
        return None
    rejected = {n: g for n, g in selection.rejected.items() if n not in chosen.names}
    selected = SelectedTerm.of(term, chosen, without, selector.seed)
    selector.on_progress(f"{' + '.join(chosen.names)}: a discrepancy term gains {selected.gain:.0f}")
    return TermSelection(replace(replaced, rejected=rejected, tried=selector.models_fitted), (selected,), without)


def add_term_and_reconsider(
    selection: Selection, selector: Selector
) -> tuple[Selection, TermSelection | None, Selector]:
    """Do as `add_term`, and repeat everything under the other initial steering if that is better now.

    While a cause is missing from the model, the runs do not determine the initial steering. Terms that predict as well
    as an effect of which they are another form are among its alternatives.
    """
    selection = with_other_forms(selection, selector)
    term_selection = add_term(selection, selector)
    if term_selection is None:
        return selection, None, selector
    if prefers_other_initial_steering(term_selection.selection.chosen, selector):
        selected, other = select_under_other_initial_steering(selector)
        again = add_term(selected, other)
        if again is not None and again.selection.chosen.deviance < term_selection.selection.chosen.deviance:
            selection, term_selection, selector = with_other_forms(selected, other), again, other
    return selection, term_selection, selector


def _may_be_mimicked(selection: Selection, with_term: ScoredModel) -> bool:
    """Return whether a term alone gains a noticeable share of what all effects gain, as if they only mimicked it."""
    gain = selection.base.deviance - with_term.deviance
    return gain > DISCREPANCY.min_share_of_effects * (selection.base.deviance - selection.chosen.deviance)


def _term_in_place_of_effect(
    extended: Selector, selection: Selection, names: Iterable[str]
) -> tuple[ScoredModel, type[DiscrepancyTerm]] | None:
    """Return the term that predicts better in the place of one of the selected effects `names`, or None.

    An effect that few runs determine is fitted to them, so that no residual is left for a regression. A term claims
    that the library lacks the cause: it must fit better than the effect, too. Only terms that do not depend on the
    position are fitted, because their simulation is as fast as that of effects.
    """
    best: tuple[ScoredModel, type[DiscrepancyTerm]] | None = None
    for name in names:
        without = extended.without_effect(selection.base, selection.chosen, name)
        # What is predicted is a gain of the fit, and not a cross-validated one.
        least = DISCREPANCY.min_share_of_effects * selection.chosen.fit_gain_over(without)
        for term in terms_without_regression(extended):
            if term.longest_step_s < math.inf:
                continue
            if extended.predicted_gain(without, term.name) < least:
                continue
            model = extended.with_effect(without, term.name)
            is_best = best is None or model.deviance < best[0].deviance
            gains = model.gain_over(selection.chosen) > extended.min_gain
            if is_best and gains and extended.meets_criterion(without, model):
                best = model, term
    return best
