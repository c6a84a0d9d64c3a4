"""The discrepancy term of free driving: a shape for what no effect of the library explains, beside the effects.

A term has no cause that would hold on another day. The errors of the test windows with and without it say whether it
holds there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from agvbench.diagnosis.criteria import DISCREPANCY, RESIDUAL
from agvbench.diagnosis.data.window_splits import thinned
from agvbench.diagnosis.discrepancy.best_term import best_term, likely_terms, linearised_terms, regressed_terms
from agvbench.diagnosis.discrepancy.screening import Start
from agvbench.diagnosis.free_driving.errors import exceeds_repeatability
from agvbench.diagnosis.free_driving.predictors import change_by_speed_error
from agvbench.diagnosis.free_driving.selection import WindowSelector
from agvbench.diagnosis.selection.actuators import ACTUATORS
from agvbench.diagnosis.selection.candidates import applies
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms import TERMS, ByLoggedColumn, DiscrepancyTerm

_RANKED_WINDOWS = 100
_MOST_MIMICKING = 3


@dataclass(frozen=True)
class SelectionWithTerm:
    """A selection with a discrepancy term, and the selector of its windows, which simulates terms."""

    terms: TermSelection
    selector: WindowSelector


def with_describing_term(selection: Selection, selector: WindowSelector) -> SelectionWithTerm | None:
    """Return the selection with the term that predicts best, and with those of its effects that are needed beside it.

    None if no term meets the criterion. No term is tried unless the model is inadequate.
    """
    if not is_inadequate(selection.chosen):
        return None
    selector.on_progress("comparing terms for what no effect of the library describes")
    if not (starts := _starts(selection, selector)):
        return None
    extended = selector.for_batch(selector.batch.repacked(kinds=EXTENDED_LIBRARY))
    extended.adopt(selection.base)
    begun = replace(selection, chosen=extended.adopt(selection.chosen))
    adopted = [(extended.adopt(root), own) for root, own in starts]
    if (found := _best_term(extended, begun, adopted)) is None:
        return None
    model, term = found
    beside, gains = _with_effects(extended, begun, model)
    if term.name not in beside.names:
        return None
    selector.on_progress(f"{' + '.join(beside.names)}: a discrepancy term gains {gains.pop(term.name):.0f}")
    alternatives = {name: selection.alternatives.get(name, {}) for name in gains}
    tried = selection.tried + extended.tried
    chosen = replace(selection, chosen=beside, gains=gains, alternatives=alternatives, tried=tried)
    without = extended.without_effect(selection.base, beside, term.name)
    selected = SelectedTerm.of(term, beside, without, selector.seed)
    return SelectionWithTerm(TermSelection(chosen, (selected,), without), extended)


def _best_term(
    extended: WindowSelector, selection: Selection, starts: list[tuple[ScoredModel, list[Start]]]
) -> tuple[ScoredModel, type[DiscrepancyTerm]] | None:
    """Return the best model with a term, and the term; None if none gains as much over the selection as an effect must.

    `starts` are models with the terms to fit beside them.
    """
    tried = [best_term(extended, root, own) for root, own in starts]
    better = [pair for pair in tried if pair is not None and pair[0].gain_over(selection.chosen) > extended.min_gain]
    return min(better, key=lambda pair: pair[0].deviance, default=None)


def _with_effects(
    extended: WindowSelector, selection: Selection, model: ScoredModel
) -> tuple[ScoredModel, dict[str, float]]:
    """Return a model with a term and the selected effects that improve it, and the gain of each.

    An effect that was selected without the term may only mimic the unknown cause.
    """
    for name in selection.gains:
        if name not in model.names and extended.improves(model, larger := extended.with_effect(model, name)):
            model = larger
    return extended.backward_elimination(selection.base, model, ACTUATORS)


def _starts(selection: Selection, selector: WindowSelector) -> list[tuple[ScoredModel, list[Start]]]:
    """Return models without terms, each with the terms to fit beside it.

    Terms are ranked by some of the windows. Beside a model that lacks selected effects, a term must be predicted to
    gain a share of what these gain.
    """
    batch = selector.batch
    some = batch.readings.select(thinned(np.arange(len(batch.readings)), _RANKED_WINDOWS))
    ranking = replace(selector, test_batch=None).for_batch(batch.repacked(some, kinds=EXTENDED_LIBRARY))
    share = len(some) / len(batch.readings)
    found = []
    for model, kind in _roots(selection, selector):
        least = DISCREPANCY.min_share_of_effects * selection.chosen.fit_gain_over(model)
        root = ranking.refitted(model)
        starts = [] if root is None else _ranked(ranking, root, kind, share * selector.min_gain)
        starts = [replace(start, gain=start.gain / share) for start in starts if start.gain > share * least]
        if starts:
            found.append((model, starts))
    return found


def _roots(selection: Selection, selector: WindowSelector) -> Iterator[tuple[ScoredModel, type[DiscrepancyTerm]]]:
    """Yield the models beside which terms are tried, and of which kind: the selection, and what may hide a cause.

    Up to three effects may mimic an unknown cause and leave nothing to a term. A lag of the drive mimics what changes
    the speed slowly, such as a voltage that was logged.
    """
    chosen = selection.chosen
    yield chosen, DiscrepancyTerm
    if 0 < len(selection.gains) <= _MOST_MIMICKING:
        yield selection.base, DiscrepancyTerm
    if selector.batch.readings.logged.regressors and len(selection.gains) > 1:
        for name in selection.gains:
            yield selector.without_effect(selection.base, chosen, name), ByLoggedColumn


def _ranked(ranking: WindowSelector, root: ScoredModel, kind: type[DiscrepancyTerm], least: float) -> list[Start]:
    """Return the terms of a kind with the largest predicted gains beside `root`, the best first.

    Noise hides a bias from the motion between two poses, of which a window has few: a linearisation decides, but for
    terms of many parameters. It must predict a gain of at `least` that.
    """
    terms = [term for term in TERMS if _is_tried(term, kind) and applies(term, ranking.batch.geometry)]
    linear = linearised_terms(ranking, root, terms, least)[: DISCREPANCY.max_starts]
    known = {start.term for start in linear}
    regressed = [start for start in regressed_terms(ranking, root) if _is_tried(start.term, kind)]
    further = [start for start in likely_terms(regressed) if start.term not in known][: DISCREPANCY.max_starts]
    return sorted([*linear, *further], key=lambda start: -start.gain)


def _is_tried(term: type[DiscrepancyTerm], kind: type[DiscrepancyTerm]) -> bool:
    return term.for_windows and issubclass(term, kind)


def is_inadequate(model: ScoredModel) -> bool:
    """Return whether an error of a model in its windows exceeds what noise and a typical repeatability explain."""
    predictor, parameters = model.fit.predictor, model.fit.parameters
    poses, perturbed = predictor.predict(parameters), change_by_speed_error(predictor, parameters)
    return exceeds_repeatability(predictor.readings, poses, perturbed, RESIDUAL.within_repeatability)
