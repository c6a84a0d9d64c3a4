"""A discrepancy term for what no effect of the library explains, with the effects that stand beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.diagnosis.discrepancy.regression import steering
from agvbench.diagnosis.discrepancy.screening import Start, screen
from agvbench.diagnosis.estimation.cross_validation import without_best_groups
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.residuals.residuals import (
    LACK_OF_FIT,
    WITHIN_REPEATABILITY,
    lack_of_fit,
    pose_residuals,
    repeatability,
)
from agvbench.diagnosis.selection.candidates import candidate
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import (
    prefers_other_initial_steering,
    select_under_other_initial_steering,
    with_extended_library,
)
from agvbench.diagnosis.selection.with_term import TermSelection, gain_p_value
from agvbench.diagnosis.terms import TERMS, DiscrepancyTerm

Settled = tuple[ScoredModel, type[DiscrepancyTerm], dict[str, float], dict[str, dict[str, float]]]
"""A model with a term, the term, the gains of the effects beside it, and their alternatives."""

_MAX_REFITTED = 3
_MAX_NAMES = 5
_TERM_NAMES = frozenset(term.name for term in TERMS)


def settled(wide: Selector, selection: Selection, current: ScoredModel, term: type[DiscrepancyTerm]) -> Settled:
    """Return the model with the term and the effects that meet the criterion beside it, their gains and alternatives.

    What was chosen without the term may only have been an alternative of what is right beside it.
    """
    base = selection.base
    alternatives: dict[str, dict[str, float]] = {}
    current = _add_masked_effects(wide, current)
    again = [n for n in selection.chosen.names if n not in current.names]
    again += sorted(selection.rejected, key=lambda n: -selection.rejected[n])[:_MAX_REFITTED]
    for name in again:
        offer = wide.with_effect(current, name)
        if name not in current.names and wide.meets_criterion(current, offer):
            current = offer
    current, alternatives = wide.with_swaps(base, current, selection.alternatives)
    while True:
        found = [n for n in current.names if n not in {*base.names, term.name}]
        smaller = {name: wide.without_effect(base, current, name) for name in found}
        gains = {name: model.deviance - current.deviance for name, model in smaller.items()}
        useless = [name for name, model in smaller.items() if not wide.meets_criterion(model, current)]
        if not useless:
            return current, term, gains, {name: alternatives.get(name, {}) for name in gains}
        current = wide.reduced(smaller[min(useless, key=lambda name: gains[name])], current)


def _add_masked_effects(wide: Selector, current: ScoredModel) -> ScoredModel:
    """Return the model with the effects that the unknown cause had masked, as long as its residuals show lack of fit.

    An effect that gained nothing beside what was chosen first may become significant as soon as the term is there. The
    gain of each is predicted, and only the best are fitted.
    """
    while len(current.names) < _MAX_NAMES and has_lack_of_fit(current):
        names = [name for name in wide.candidates if name not in current.names and name not in _TERM_NAMES]
        predicted_gains = {name: wide.predicted_gain(current, name) for name in names}
        best = sorted(predicted_gains, key=lambda name: -predicted_gains[name])[:_MAX_REFITTED]
        offers = [wide.with_effect(current, name) for name in best if predicted_gains[name] > wide.min_gain]
        worthy = [offer for offer in offers if wide.meets_criterion(current, offer)]
        if not worthy:
            break
        current = min(worthy, key=lambda offer: offer.deviance)
    return current


def has_lack_of_fit(model: ScoredModel) -> bool:
    """Whether the residuals are above repeatability, and differ between groups beyond it."""
    predictor = model.fit.predictor
    residuals = pose_residuals(predictor.readings, predictor.predict(model.fit.parameters))
    least, group = repeatability(residuals, predictor.readings.group), predictor.readings.group
    p_value = lack_of_fit(residuals, group)
    if least is None or p_value is None or p_value >= LACK_OF_FIT:
        return False
    return any(
        residuals.rms()[name] > WITHIN_REPEATABILITY * least[name] for name in ("position_rms_mm", "heading_rms_deg")
    )


_MAX_STARTS = 3
_MIN_PREDICTED_GAIN = 4.0
_MIN_SHARE_OF_BEST = 0.3
_FEW = 0.1


def add_term(selection: Selection, selector: Selector) -> TermSelection | None:
    """Return the best empirical term, with the effects that meet the criterion beside it; None if no term meets it.

    Terms are tried beside the effects chosen, and where none helps there beside none: an effect that only mimics the
    unknown cause is removed as soon as the term is there. Where their predicted gain is larger beside none than beside
    what was chosen, they are tried so first, and what was chosen is tried again beside them.

    Parameters
    ----------
    selection
        What was chosen from the library.
    selector
        That chose it.
    """
    wide = with_extended_library(selector)
    starts = screened_terms(wide, selection.chosen)
    found: list[tuple[ScoredModel, type[DiscrepancyTerm]] | None] = []
    if starts or has_lack_of_fit(selection.chosen):
        alone = screened_terms(wide, selection.base) if selection.gains else []
        gains_more = bool(alone) and alone[0].gain > max((start.gain for start in starts), default=0.0)
        first = _best_term(wide, selection.base, alone) if gains_more else None
        if first is not None and first[0].deviance < selection.chosen.deviance:
            found.append(first)
        else:
            found.append(_best_term(wide, selection.chosen, starts))
            if found[0] is None and selection.gains:
                found += [first or _best_term(wide, selection.base, alone), _term_in_place_of_effect(wide, selection)]
    elif any(_depends_on_few_groups(selector, selection, name) for name in selection.gains):
        found.append(_term_in_place_of_effect(wide, selection))
    models = [settled(wide, selection, *pair) for pair in found if pair is not None]
    return _explained(wide, selection, selector, models)


def term_in_place(selection: Selection, selector: Selector) -> TermSelection | None:
    """Return the term that predicts better in the place of an effect that was chosen; None if none does.

    For models that fail in validation although the training runs show no lack of fit: another effect mimics there a
    cause that few training runs excite.
    """
    wide = with_extended_library(selector)
    found = _term_in_place_of_effect(wide, selection)
    return _explained(wide, selection, selector, [] if found is None else [settled(wide, selection, *found)])


def _explained(wide: Selector, selection: Selection, selector: Selector, models: list[Settled]) -> TermSelection | None:
    """Return the best of the models with a term, if that meets the criterion."""
    models = [model for model in models if model[0].deviance < selection.chosen.deviance - selector.min_gain]
    if not models:
        return None
    chosen, term, gains, alternatives = min(models, key=lambda model: model[0].deviance)
    without = wide.refitted_from(wide.without_effect(selection.base, chosen, term.name), chosen)
    if not wide.meets_criterion(without, chosen):
        return None
    gain = without.loss - chosen.loss
    tried = selection.tried + wide.tried
    rejected = {n: g for n, g in selection.rejected.items() if n not in chosen.names}
    selector.on_progress(f"{' + '.join(chosen.names)}: an empirical term gains {gain.sum():.0f}")
    return TermSelection(
        Selection(selection.base, chosen, alternatives, gains, rejected, tried),
        term,
        without,
        float(gain.sum()),
        gain_p_value(gain, wide.batch.readings.group, selector.seed),
    )


def add_term_and_reconsider(
    selection: Selection, selector: Selector
) -> tuple[Selection, TermSelection | None, Selector]:
    """Do as `add_term` does, and all again under the other initial steering if that is better now.

    While a cause is missing from the model, the runs do not show where a slow servo stood before them.
    """
    term_selection = add_term(selection, selector)
    if term_selection is None:
        return selection, None, selector
    if prefers_other_initial_steering(term_selection.selection.chosen, selector):
        selected, other = select_under_other_initial_steering(selector)
        again = add_term(selected, other)
        if again is not None and again.selection.chosen.deviance < term_selection.selection.chosen.deviance:
            selection, term_selection, selector = selected, again, other
    return selection, _reselect_from_term(selection, term_selection, selector), selector


def _reselect_from_term(selection: Selection, term_selection: TermSelection, selector: Selector) -> TermSelection:
    """Return what comes of the term beside none of the effects that were chosen before it, where that is better.

    What was chosen without the unknown cause may only look like what is right beside its term. It is not refitted where
    the residuals show no lack of fit.
    """
    if not selection.gains or not has_lack_of_fit(term_selection.selection.chosen):
        return term_selection
    wide, term = with_extended_library(selector), term_selection.term
    kind, values = candidate(term), np.array([list(term_selection.values.values())])
    alone = wide.with_effect(selection.base, term.name, replace(kind, starts=values, screened=True, patient=True))
    if not alone.is_fitted:
        return term_selection
    bare = replace(selection, chosen=selection.base, gains={}, alternatives={})
    again = _explained(wide, selection, selector, [settled(wide, bare, alone, term)])
    return (
        again
        if again is not None and again.selection.chosen.deviance < term_selection.selection.chosen.deviance
        else term_selection
    )


def screened_terms(wide: Selector, root: ScoredModel) -> list[Start]:
    """Return the terms that are predicted to describe the residuals of `root`, the best first."""
    batch = wide.batch
    poses = root.fit.predictor.predict(root.fit.parameters)
    rates = residual_rates(batch.readings, poses)
    stands = steering(batch, root.fit.parameters, rates)
    starts = screen(rates, stands, batch.geometry, batch.readings.group, wide.seed)
    least = max(_MIN_PREDICTED_GAIN, _MIN_SHARE_OF_BEST * starts[0].gain) if starts else 0.0
    return [start for start in starts if start.gain > least][:_MAX_STARTS]


def _best_term(
    wide: Selector, root: ScoredModel, starts: list[Start]
) -> tuple[ScoredModel, type[DiscrepancyTerm]] | None:
    best: tuple[ScoredModel, type[DiscrepancyTerm]] | None = None
    for start in starts:
        kind = candidate(start.term)
        values = np.clip(start.values, kind.bounds[:, 0], kind.bounds[:, 1])
        screened = replace(kind, starts=values, screened=True, patient=start is starts[0])
        offer = wide.with_effect(root, start.term.name, screened)
        if wide.meets_criterion(root, offer) and (best is None or offer.deviance < best[0].deviance):
            best = offer, start.term
    return best


def _depends_on_few_groups(selector: Selector, selection: Selection, name: str) -> bool:
    """Return whether some groups of runs hold most of what an effect gains."""
    chosen = selection.chosen
    rest = tuple(n for n in chosen.names if n != name)
    without = selection.base if rest == selection.base.names else selector.known(rest)
    if without is None:
        return False
    gain = without.loss - chosen.loss
    return without_best_groups(gain, selector.batch.readings.group, _FEW) < 0.5 * float(gain.sum())


def _term_in_place_of_effect(wide: Selector, selection: Selection) -> tuple[ScoredModel, type[DiscrepancyTerm]] | None:
    """Return the term that predicts better in the place of an effect that was chosen, if one does.

    An effect that few runs show is fitted to them and leaves nothing for a regression to find. Only terms that depend
    on no place are tried, for they are simulated as fast as effects.
    """
    best: tuple[ScoredModel, type[DiscrepancyTerm]] | None = None
    for name in selection.gains:
        rest = wide.without_effect(selection.base, selection.chosen, name)
        for term in (term for term in TERMS if not term.local):
            offer = wide.with_effect(rest, term.name)
            if offer.deviance < (best[0] if best else selection.chosen).deviance and wide.meets_criterion(rest, offer):
                best = offer, term
    return best
