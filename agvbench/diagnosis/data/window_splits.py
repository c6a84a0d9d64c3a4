"""The split of windows into training and test windows, and their cross-validation groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.windows import InitialStates
from agvbench.errors import FitError

_MAX_SHARE = 1.0 / 3.0
_MIN_TRAINING_SESSIONS = 2
_MIN_FOLDS = 4


def held_out_windows(readings: Readings, seed: int) -> NDArray[np.bool_]:
    """Return which windows are test windows, (W,).

    A campaign's own ``split`` column takes precedence. Otherwise whole sessions are drawn at random, because a model
    has to predict other days: about a quarter of the windows, and at most a third. Of three or more sessions at least
    two remain for training. With one session, whole recordings are drawn, and with one recording blocks of it.

    Raises
    ------
    FitError
        If the campaign's column ``split`` names all or none of its windows for test.
    """
    split = [run.split for run in readings.runs]
    if any(split):
        held = np.array([name == "held_out" for name in split])
        if held.all() or not held.any():
            raise FitError("the column split must name training runs and test runs", where="runs", value=set(split))
        return held
    rng = np.random.default_rng([0xD1A7, seed])
    initial_states = _initial_states(readings)
    for names, kept in (
        (initial_states.session, _MIN_TRAINING_SESSIONS),
        (initial_states.recording, 1),
        (readings.group.astype(np.str_), 1),
    ):
        held = _drawn(names, kept, rng)
        if held.any():
            return held
    return np.zeros(len(readings), dtype=np.bool_)


def test_sessions(readings: Readings, held: NDArray[np.bool_]) -> set[str]:
    """Return the sessions of which all windows are test windows."""
    session = _initial_states(readings).session
    return set(session[held].tolist()) - set(session[~held].tolist())


def fold_groups(readings: Readings) -> NDArray[np.int64]:
    """Return the groups that cross-validation leaves out as a whole, (R,).

    They are groups of runs with the same commands. For windows they are sessions if there are enough of them, otherwise
    recordings, otherwise blocks: the model has to predict driving that it was not fitted to.
    """
    if readings.initial_states is None:
        return readings.group
    for names in (readings.initial_states.session, readings.initial_states.recording):
        known, number = np.unique(names, return_inverse=True)
        if len(known) >= _MIN_FOLDS:
            return number.astype(np.int64)
    return readings.group


def _initial_states(readings: Readings) -> InitialStates:
    assert readings.initial_states is not None, "windows have initial states"  # noqa: S101 - a contract between two files
    return readings.initial_states


def _drawn(names: NDArray[np.str_], kept: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which rows have the names drawn at random: about a quarter of the rows."""
    known = np.unique(names)
    held = np.zeros(len(names), dtype=np.bool_)
    spare = len(known) - min(kept, len(known) - 1)
    for name in rng.permutation(known).tolist():
        own = names == name
        share = (np.count_nonzero(held) + np.count_nonzero(own)) / len(names)
        if spare and share <= _MAX_SHARE and np.count_nonzero(held) < DATA.test_share * len(names):
            held |= own
            spare -= 1
    return held


def thinned(index: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return at most `most` of the indices, evenly spaced."""
    if len(index) <= most:
        return index
    return index[np.unique(np.round(np.linspace(0, len(index) - 1, most)).astype(np.int64))]


def fitted_windows(training: Readings) -> Readings:
    """Return evenly spaced windows of the `training`, the fewer the more commands take effect within each."""
    fitted = training.select(thinned(np.arange(len(training)), DATA.max_fitted_windows))
    simulated = zip(fitted.simulated(), fitted.begins_s, strict=True)
    commands = sum(np.count_nonzero(run.commands.t_s > begins_s) for run, begins_s in simulated)
    if commands <= DATA.max_fitted_commands:
        return fitted
    most = max(DATA.min_fitted_windows, round(len(fitted) * DATA.max_fitted_commands / commands))
    return training.select(thinned(np.arange(len(training)), most))
