"""Split of windows into test windows and windows to fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import HELD_OUT_SHARE
from agvbench.diagnosis.data.windows import InitialStates
from agvbench.errors import FitError

MOST_FITTED = 300
"""Fits use at most so many windows, evenly spaced: neighbours are correlated."""

MOST_JUDGED = 1500
_MOST_SHARE = 1.0 / 3.0
_KEPT_SESSIONS = 2
_FEWEST_FOLDS = 4


def held_out_windows(readings: Readings, seed: int) -> NDArray[np.bool_]:
    """Return which windows are test windows, (W,).

    The campaign's own ``split`` decides where it has one. Else whole sessions are drawn, since another day is what a
    model has to stand: about a quarter of the windows, a third at most, and two sessions stay to be fitted to where
    there are three. With one session, whole recordings are drawn, and with one recording stretches of it.

    Raises
    ------
    FitError
        If the campaign sets all or none of its windows aside.
    """
    split = [run.split for run in readings.runs]
    if any(split):
        held = np.array([name == "held_out" for name in split])
        if held.all() or not held.any():
            raise FitError("the column split must name runs to fit and runs held out", where="runs", value=set(split))
        return held
    rng = np.random.default_rng([0xD1A7, seed])
    initial_states = _initial_states(readings)
    for names, kept in (
        (initial_states.session, _KEPT_SESSIONS),
        (initial_states.recording, 1),
        (readings.group.astype(np.str_), 1),
    ):
        held = _drawn(names, kept, rng)
        if held.any():
            return held
    return np.zeros(len(readings), dtype=np.bool_)


def fold_groups(readings: Readings) -> NDArray[np.int64]:
    """Return what cross-validation leaves out together, (R,): groups of runs, or sessions or recordings of windows.

    Whole sessions where there are enough of them, else recordings, else stretches: what is learnt has to hold
    elsewhere.
    """
    if readings.initial_states is None:
        return readings.group
    for names in (readings.initial_states.session, readings.initial_states.recording):
        known, number = np.unique(names, return_inverse=True)
        if len(known) >= _FEWEST_FOLDS:
            return number.astype(np.int64)
    return readings.group


def _initial_states(readings: Readings) -> InitialStates:
    assert readings.initial_states is not None, "windows have initial states"  # noqa: S101 - a contract between two files
    return readings.initial_states


def _drawn(names: NDArray[np.str_], kept: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which rows belong to the names drawn: about a quarter of the rows."""
    known = np.unique(names)
    held = np.zeros(len(names), dtype=np.bool_)
    spare = len(known) - min(kept, len(known) - 1)
    for name in rng.permutation(known).tolist():
        own = names == name
        share = (np.count_nonzero(held) + np.count_nonzero(own)) / len(names)
        if spare and share <= _MOST_SHARE and np.count_nonzero(held) < HELD_OUT_SHARE * len(names):
            held |= own
            spare -= 1
    return held


def thinned(index: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return at most `most` of the indices, evenly spaced."""
    if len(index) <= most:
        return index
    return index[np.unique(np.round(np.linspace(0, len(index) - 1, most)).astype(np.int64))]
