"""Selection in a subsample of the runs, and the final fit to all training runs.

Further repeats reduce the standard errors of parameters, but hardly help to select effects. Fitting hundreds of models
to all runs would take minutes and gigabytes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import thinned
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.selection.with_term import TermSelection

_MIN_REPEATS = 2


def subsample_repeats(group: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """Return the runs for the selection, (R,): an equal number of repeats per group, evenly spaced over the session.

    Parameters
    ----------
    group
        (R,): the group of each run, in the order of the runs.
    most
        The largest number of runs, unless two repeats per group are more.
    """
    sizes = np.bincount(group)
    repeats = np.arange(_MIN_REPEATS, max(int(sizes.max()), _MIN_REPEATS) + 1)
    total = np.minimum(sizes[:, None], repeats).sum(axis=0)
    per_group = int(repeats[max(int(np.searchsorted(total, most, side="right")) - 1, 0)])
    chosen = np.zeros(len(group), dtype=np.bool_)
    for g in np.unique(group):
        chosen[thinned(np.flatnonzero(group == g), per_group)] = True
    return chosen


def refit_to_all(
    selection: Selection, term_selection: TermSelection | None, selector: Selector, readings: Readings
) -> tuple[Selection, TermSelection | None]:
    """Refit the selected models to further runs; gains and alternatives stay those of the subsample.

    Parameters
    ----------
    selection, term_selection
        The selection in the subsample.
    selector
        The selector of the subsample.
    readings
        The runs of the subsample, and others.
    """
    batch = selector.batch
    preset = replace(readings, preset=batch.readings.preset)
    on_all = selector.for_batch(Batch(preset, batch.maps, batch.geometry, kinds=EXTENDED_LIBRARY))

    def refitted(model: ScoredModel) -> ScoredModel:
        return on_all.score(model.names, model.fit.parameters, None)

    def both(found: Selection) -> Selection:
        return replace(found, base=refitted(found.base), chosen=refitted(found.chosen))

    if term_selection is None:
        return both(selection), None
    terms = tuple(replace(one, without=refitted(one.without)) for one in term_selection.terms)
    without = refitted(term_selection.without)
    return both(selection), TermSelection(both(term_selection.selection), terms, without)


def refit_with_heavy_tails(
    selection: Selection, term_selection: TermSelection | None, selector: Selector
) -> tuple[Selection, TermSelection | None]:
    """Refit the chosen model with heavy tails to the runs to which it is fitted, if it lacks fit.

    A model that lacks a cause is far from a few runs. With normal errors these would determine its parameters, at the
    expense of all runs that it does describe.
    """
    found = term_selection.selection if term_selection else selection
    if not has_lack_of_fit(found.chosen):
        return selection, term_selection
    names, fitted = found.chosen.names, found.chosen.fit
    robust = selector.for_batch(fitted.predictor.batch.with_heavy_tails())
    begun = replace(fitted, predictor=Predictor(robust.batch, names))
    try:
        found = replace(found, chosen=robust.score(names, fitted.parameters, begun, patient=True))
    except np.linalg.LinAlgError:
        return selection, term_selection  # the fit diverged
    return (selection, replace(term_selection, selection=found)) if term_selection else (found, None)
