"""Discrepancy terms that are another form of a selected effect, fitted in its place even if no residual is left.

The steps of a campaign are much larger than a gap, and the maps absorb what depends on the command alone. Backlash and
another hysteresis of the steering may therefore leave the same residual, within repeatability. A name needs more: the
runs must contradict the other form.
"""

from __future__ import annotations

from dataclasses import replace

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import with_extended_library
from agvbench.diagnosis.terms import TERMS, DiscrepancyTerm
from agvbench.effects.variants import cause_of

ModelInPlace = tuple[str, type[DiscrepancyTerm], ScoredModel]
"""An effect, the term that is another form of it, and the model with the term in its place."""


def models_of_other_forms(extended: Selector, selection: Selection) -> list[ModelInPlace]:
    """Return the selected model with each term that is another form of one of its effects in the place of that effect.

    A term must predict enough better there. While causes beside it are missing, Wald's test does not judge it.
    """
    found = []
    for name in selection.gains:
        for term in (term for term in TERMS if cause_of(name) in term.form_of):
            without = extended.without_effect(selection.base, selection.chosen, name)
            model = extended.with_effect(without, term.name)
            if model.is_fitted and extended.improves(without, model):
                found.append((name, term, model))
    return found


def with_other_forms(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with the terms that predict as well in the place of an effect, as its alternatives."""
    models = models_of_other_forms(with_extended_library(selector), selection)
    if not models:
        return selection
    alternatives = dict(selection.alternatives)
    for name, term, model in models:
        worse = model.deviance - selection.chosen.deviance
        if worse < SELECTION.alternative_margin:
            alternatives[name] = alternatives.get(name, {}) | {term.name: worse}
    return replace(selection, alternatives=alternatives, tried=selector.models_fitted)
