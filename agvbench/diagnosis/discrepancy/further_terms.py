"""Further discrepancy terms beside the first, as long as the residual lacks fit: a vehicle may have several causes."""

from __future__ import annotations

from dataclasses import replace

from agvbench.diagnosis.criteria import DISCREPANCY
from agvbench.diagnosis.discrepancy.best_term import best_term, screened_terms
from agvbench.diagnosis.discrepancy.stepwise import TERM_NAMES, add_masked_effects
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms import TERMS


def with_further_terms(found: TermSelection, extended: Selector) -> TermSelection:
    """Return the selection with further terms that meet the criterion, and with the effects that are needed beside."""
    while len(found.terms) < DISCREPANCY.max_terms and has_lack_of_fit(found.selection.chosen):
        again = _with_one_more(found, extended)
        if again is None or again.selection.chosen.deviance >= found.selection.chosen.deviance:
            break
        found = again
        names = " + ".join(found.selection.chosen.names)
        extended.on_progress(f"{names}: a further discrepancy term gains {found.terms[-1].gain:.0f}")
    return found


def _with_one_more(found: TermSelection, extended: Selector) -> TermSelection | None:
    """Return the selection with one more term, without what is then unnecessary; None if no term helps."""
    selection, known = found.selection, [one.term.name for one in found.terms]
    starts = [one for one in screened_terms(extended, selection.chosen) if one.term.name not in known]
    best = best_term(extended, selection.chosen, starts)
    if best is None:
        return None
    model, added = add_masked_effects(extended, best[0]), best[1].name
    chosen, gains = extended.backward_elimination(selection.base, model)
    if added not in chosen.names:
        return None
    terms, without = _terms_of(chosen, [*known, added], extended, selection.base)
    return TermSelection(_selection_with(selection, chosen, gains, extended), terms, without)


def _terms_of(
    chosen: ScoredModel, names: list[str], extended: Selector, base: ScoredModel
) -> tuple[tuple[SelectedTerm, ...], ScoredModel]:
    """Return the terms of a model, in the order of `names`, and the model without all of them."""
    kinds = {term.name: term for term in TERMS if term.name in chosen.names}
    present = [name for name in names if name in kinds]
    terms = tuple(
        SelectedTerm.of(kinds[name], chosen, extended.without_effect(base, chosen, name), extended.seed)
        for name in present
    )
    without = chosen
    for name in present:
        without = extended.without_effect(base, without, name)
    return terms, without


def _selection_with(
    selection: Selection, chosen: ScoredModel, gains: dict[str, float], extended: Selector
) -> Selection:
    """Return the selection with another model; its effects keep the alternatives that are known."""
    gains = {name: gain for name, gain in gains.items() if name not in TERM_NAMES}
    alternatives = {name: selection.alternatives.get(name, {}) for name in gains}
    rejected = {name: gain for name, gain in selection.rejected.items() if name not in chosen.names}
    tried = extended.models_fitted
    return replace(selection, chosen=chosen, gains=gains, alternatives=alternatives, rejected=rejected, tried=tried)
