"""Causes are looked for in some hundred runs and measured in all of them.

Repeats beyond a few say more of how large a cause is, and hardly more of which: trying hundreds of models on all of
them costs minutes and gigabytes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import thinned
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import BEYOND
from agvbench.diagnosis.selection.with_term import TermSelection

MOST_RUNS = 240
"""In so many runs causes are looked for, as far as commands with a repeat each leave it at that."""

_FEWEST_REPEATS = 2


def some_repeats(group: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """Return which runs to look for causes in, (R,): as many repeats of each group, spread over the session.

    Parameters
    ----------
    group
        (R,): a number for each run, in the order in which they were driven; repeats share it.
    most
        So many runs are enough.
    """
    sizes = np.bincount(group)
    repeats = np.arange(_FEWEST_REPEATS, max(int(sizes.max()), _FEWEST_REPEATS) + 1)
    total = np.minimum(sizes[:, None], repeats).sum(axis=0)
    fair = int(repeats[max(int(np.searchsorted(total, most, side="right")) - 1, 0)])
    chosen = np.zeros(len(group), dtype=np.bool_)
    for g in np.unique(group):
        chosen[thinned(np.flatnonzero(group == g), fair)] = True
    return chosen


def measured_in_all(
    selection: Selection, term_selection: TermSelection | None, selector: Selector, readings: Readings
) -> tuple[Selection, TermSelection | None]:
    """Return what was found with its models fitted to all training runs; gains and alternatives stay as found.

    Parameters
    ----------
    selection, explained
        What was found in some of the runs.
    selector
        That found it.
    readings
        All runs to be fitted.
    """
    batch = selector.batch
    preset = replace(readings, preset=batch.readings.preset)
    whole = selector.over(Batch(preset, batch.maps, batch.geometry, kinds=BEYOND))

    def again(model: ScoredModel) -> ScoredModel:
        return whole.score(model.names, model.fit.parameters, None)

    def both(found: Selection) -> Selection:
        return replace(found, base=again(found.base), chosen=again(found.chosen))

    if term_selection is None:
        return both(selection), None
    term = replace(term_selection, selection=both(term_selection.selection), without=again(term_selection.without))
    return both(selection), term
