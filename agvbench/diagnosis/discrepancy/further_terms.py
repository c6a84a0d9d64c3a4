"""Further discrepancy terms beside the first, as long as the residual lacks fit: a vehicle may have several causes."""

from __future__ import annotations

from dataclasses import replace

from agvbench.diagnosis.discrepancy.stepwise import TERM_NAMES, add_masked_effects, best_term, screened_terms
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.stepwise import Selector
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms import TERMS

_MOST = 3


def with_further_terms(found: TermSelection, extended: Selector) -> TermSelection:
    """Return the selection with further terms that meet the criterion, and with the effects that are needed beside."""
    while len(found.terms) < _MOST and has_lack_of_fit(found.selection.chosen):
        again = _with_one_more(found, extended)
        if again is None or again.selection.chosen.deviance >= found.selection.chosen.deviance:
            break
        found = again
        names = " + ".join(found.selection.chosen.names)
        extended.on_progress(f"{names}: a further discrepancy term gains {found.terms[-1].gain:.0f}")
    return found


def _with_one_more(found: TermSelection, extended: Selector) -> TermSelection | None:
    """Return the selection with one more term, without what is then unnecessary; None if no term helps."""
    selection, before = found.selection, {one.term.name for one in found.terms}
    starts = [one for one in screened_terms(extended, selection.chosen) if one.term.name not in before]
    best = best_term(extended, selection.chosen, starts)
    if best is None:
        return None
    model = add_masked_effects(extended, best[0])
    chosen, gains = extended.backward_elimination(selection.base, model)
    kinds = {term.name: term for term in TERMS if term.name in chosen.names}
    if best[1].name not in kinds:
        return None
    ordered = [name for name in (*(one.term.name for one in found.terms), best[1].name) if name in kinds]
    terms = tuple(
        SelectedTerm.of(kinds[name], chosen, extended.without_effect(selection.base, chosen, name), extended.seed)
        for name in ordered
    )
    without = chosen
    for name in ordered:
        without = extended.without_effect(selection.base, without, name)
    gains = {name: gain for name, gain in gains.items() if name not in TERM_NAMES}
    alternatives = {name: selection.alternatives.get(name, {}) for name in gains}
    rejected = {name: gain for name, gain in selection.rejected.items() if name not in chosen.names}
    again = replace(
        selection, chosen=chosen, gains=gains, alternatives=alternatives, rejected=rejected,
        tried=extended.models_fitted,
    )  # fmt: skip
    return TermSelection(again, terms, without)
