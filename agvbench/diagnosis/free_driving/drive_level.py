"""The level of the drive: how fast the same command drives the vehicle in different sessions.

A battery is charged or a floor is swept between sessions. What a prediction knows of a window's level is its initial
speed beside the speed that the commands before it result in; no pose after the beginning of a window is used. Whether
sessions differ is also shown by the distances that are driven in windows with one command. A distance has much less
noise than a speed, but a recording may have few such windows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from agvbench.calibration.measurement.windows import held_command
from agvbench.diagnosis.criteria import FREE_DRIVING_LEVEL
from agvbench.diagnosis.data.differing_sessions import differing_sessions, others
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.model.simulation.layout import INITIAL_SPEED
from agvbench.model.simulation.simulation import Simulation
from agvbench.signals import robust_std
from agvbench.types import Commands, Floats

_SHORT_S = 0.01
_SLOW_MPS = 0.05
_MOST_KNOTS, _WINDOWS_PER_KNOT, _ROUNDS = 15, 8, 5
_LEAST_OVERLAP = 0.02
"""Less of a session's windows beside commands of other sessions says nothing about its level."""


def nodal_deviation(predictor: Predictor, parameters: Floats) -> float:
    """Return the standard deviation of the logarithm of the speed about the prediction, within sessions, times two.

    A larger deviation of the initial speed of a window indicates another drive level.
    """
    deviation = _speed_deviations(predictor, parameters)
    session = _initial_states(predictor.readings).session
    known = np.isfinite(deviation)
    deviation, session = deviation[known], session[known]
    for name in np.unique(session):
        deviation[session == name] -= np.median(deviation[session == name])
    least = FREE_DRIVING_LEVEL.min_deviation
    return max(least, 2.0 * robust_std(deviation)) if len(deviation) else least


@dataclass(frozen=True)
class DriveLevel:
    """The speed of one session over that of the others under the same commands, with its standard error."""

    factor: float
    stderr: float
    significant: bool

    @property
    def ratio(self) -> float:
        """The difference of the logarithm of the speed over its standard error."""
        return float(abs(np.log(self.factor)) * self.factor / max(self.stderr, 1e-9))


def drive_levels(readings: Readings, predictor: Predictor, parameters: Floats) -> dict[str, DriveLevel]:
    """Return the level of the drive of each session of `readings`, beside the sessions that do not differ.

    It is that of the distances of windows with one command, or that of the initial speeds: the one with the smaller
    standard errors.
    """
    batch = Batch(readings, predictor.maps, predictor.batch.geometry, kinds=predictor.batch.kinds)
    static, maps = Predictor(batch), parameters[: predictor.maps.size]
    by_speed = _levels(readings, _speed_deviations(static, maps))
    by_distance = _levels(readings, _distance_deviations(static, maps))
    if not by_speed:
        return by_distance
    is_better = by_speed.keys() <= by_distance.keys() and _mean_square(by_distance) < _mean_square(by_speed)
    return by_distance if is_better else by_speed


def _mean_square(levels: Mapping[str, DriveLevel]) -> float:
    """Return the mean square of the standard errors of levels, relative to these."""
    return float(np.mean([(level.stderr / level.factor) ** 2 for level in levels.values()]))


def _levels(readings: Readings, deviation: Floats) -> dict[str, DriveLevel]:
    """Return the levels by the `deviation` (W,) of windows from the prediction; those that are NaN do not count.

    The maps were fitted to several sessions, and absorbed a part of what differs where these gave other commands.
    A common curve over the command, with a level for each session, gives that part back. Deviations from the curve are
    compared between each session and the others by Student's test, with blocks of driving as units; see
    `differing_sessions`.
    """
    known = np.isfinite(deviation)
    if not known.any():
        return {}
    initial_states = _initial_states(readings)
    session = initial_states.session[known]
    at = zip(np.flatnonzero(known).tolist(), initial_states.t_s[known], strict=True)
    command = np.array([held_command(readings.runs[i].commands, "drive", t) for i, t in at])
    curve, inflation = _common_curve(command, deviation[known], session)
    beside = deviation[known] - curve
    blocks, first, index = np.unique(readings.group[known], return_index=True, return_inverse=True)
    middle = np.array([np.median(beside[index == k]) for k in range(len(blocks))])
    sessions = {
        str(name): _Session(middle[session[first] == name], inflation[str(name)]) for name in np.unique(session)
    }

    def deviates(one: _Session, rest: list[_Session]) -> float | None:
        level = _level(one, rest, len(sessions))
        return level.ratio if level.significant else None

    differing = differing_sessions(sessions, deviates, lambda one: len(one.blocks))
    common = {name: one for name, one in sessions.items() if name not in differing}
    levels = {name: _level(one, others(common, name), len(sessions)) for name, one in sessions.items()}
    return {name: replace(level, significant=name in differing) for name, level in levels.items()}


@dataclass(frozen=True)
class _Session:
    """Deviations of a session's ``blocks`` (n,), and by how much the common curve widens the level's standard error."""

    blocks: Floats
    inflation: float


def _common_curve(x: Floats, y: Floats, session: NDArray[np.str_]) -> tuple[Floats, dict[str, float]]:
    """Return the curve of `y` (n,) over `x` (n,) at each point, fitted with a level for each session.

    Also by session by how much the curve widens the standard error of its level: infinitely where the session gave
    commands that no other one gave.
    """
    names = np.unique(session)
    count = min(_MOST_KNOTS, len(x) // _WINDOWS_PER_KNOT)
    knots = np.unique(np.quantile(x, np.linspace(0.0, 1.0, count))) if count > 1 else np.empty(0)
    if len(names) < 2 or len(knots) < 2:
        return np.zeros(len(y)), {str(name): 1.0 for name in names}
    hats = np.column_stack([np.interp(x, knots, row) for row in np.eye(len(knots))])
    levels = (session[:, None] == names).astype(np.float64)
    design = np.column_stack([hats, levels[:, 1:]])
    # Windows with large deviations, such as those during a lag, must not bend the curve.
    weight = np.ones(len(y))
    for _ in range(_ROUNDS):
        solution, *_ = np.linalg.lstsq(design * weight[:, None], weight * y, rcond=1e-6)
        off = y - design @ solution
        scale = max(robust_std(off), 1e-6)
        weight = np.sqrt(np.minimum(1.0, 2.0 * scale / np.maximum(np.abs(off), 1e-12)))
    inflation = {str(name): _inflation(hats, one) for name, one in zip(names, levels.T, strict=True)}
    return hats @ solution[: len(knots)], inflation


def _inflation(hats: Floats, own: Floats) -> float:
    """Return by how much a level's standard error grows since a curve is fitted beside it."""
    rest = own - hats @ np.linalg.lstsq(hats, own, rcond=None)[0]
    left, total = float(rest @ rest), float(np.sum((own - own.mean()) ** 2))
    return float(np.sqrt(total / left)) if left > _LEAST_OVERLAP * total else np.inf


def _level(session: _Session, rest: list[_Session], sessions: int) -> DriveLevel:
    """Return the level of a session's blocks against others, tested at the level of all `sessions` (Bonferroni)."""
    one, other = session.blocks, np.concatenate([np.empty(0), *(each.blocks for each in rest)])
    freedom = len(one) + len(other) - 2
    if freedom < 1 or not len(other):
        return DriveLevel(1.0, np.inf, significant=False)
    difference = float(np.mean(one) - np.mean(other))
    pooled = (np.sum((one - np.mean(one)) ** 2) + np.sum((other - np.mean(other)) ** 2)) / freedom
    stderr = session.inflation * float(np.sqrt(pooled * (1.0 / len(one) + 1.0 / len(other))))
    critical = -float(stdtrit(freedom, 0.5 * FREE_DRIVING_LEVEL.alpha / sessions))
    significant = abs(difference) > max(FREE_DRIVING_LEVEL.min_deviation, critical * stderr)
    return DriveLevel(float(np.exp(difference)), float(np.exp(difference)) * stderr, significant)


def _distance_deviations(predictor: Predictor, parameters: Floats) -> Floats:
    """Return the logarithm of the distance driven in each window over the predicted one, (W,).

    NaN for a short distance and for windows with several commands. The prediction begins with the speed that earlier
    commands result in, as if no speed had been measured.
    """
    readings, rows = predictor.readings, np.arange(len(predictor.readings))
    settled, initial = predictor.settled(parameters)
    initial[:, INITIAL_SPEED] = np.nan
    poses = predictor.batch.base.predict(settled, predictor.all_parameters(parameters), initial)
    last = readings.seen.shape[1] - 1 - np.argmax(readings.seen[:, ::-1], axis=1)
    ends = readings.poses[rows, last], poses.reshape(len(rows), -1, 3)[rows, last]
    driven, predicted = (np.linalg.norm(end[:, :2] - readings.start[:, :2], axis=1) for end in ends)
    begins_s, ends_s = _initial_states(readings).t_s, readings.t_s[:, -1]
    spans = zip(readings.runs, begins_s, ends_s, strict=True)
    is_held = np.array([_is_held(run.commands, begin_s, end_s) for run, begin_s, end_s in spans])
    use = is_held & (np.minimum(driven, predicted) > _SLOW_MPS * (ends_s - begins_s))
    out = np.full(len(rows), np.nan)
    out[use] = np.log(driven[use] / predicted[use])
    return out


def _is_held(commands: Commands, begin_s: float, end_s: float) -> bool:
    """Return whether the drive has one command from `begin_s` to `end_s`."""
    first, last = np.searchsorted(commands.t_s, [begin_s, end_s], side="right") - 1
    return bool(np.ptp(commands.drive[max(int(first), 0) : max(int(last), 0) + 1]) == 0.0)


def _speed_deviations(predictor: Predictor, parameters: Floats) -> Floats:
    """Return the logarithm of the initial speed over the predicted one, (W,); NaN at low speed."""
    initial_states, batch = _initial_states(predictor.readings), predictor.batch
    short_runs = [
        replace(run, t_s=np.array([begins_s + _SHORT_S]))
        for run, begins_s in zip(predictor.readings.simulated(), initial_states.t_s.tolist(), strict=True)
    ]
    settled, initial = predictor.settled(parameters)
    initial[:, INITIAL_SPEED] = np.nan
    simulation = Simulation(batch.geometry, batch.maps.neutral, short_runs, kinds=batch.kinds)
    moved = simulation.predict(settled, predictor.all_parameters(parameters), initial) - initial[:, :3]
    predicted = (np.cos(initial[:, 2]) * moved[:, 0] + np.sin(initial[:, 2]) * moved[:, 1]) / _SHORT_S
    use = (
        (np.abs(predicted) > _SLOW_MPS)
        & (predicted * initial_states.speed_mps > 0.0)
        & (np.abs(initial_states.speed_mps) > _SLOW_MPS)
    )
    out = np.full(len(predicted), np.nan)
    out[use] = np.log(np.abs(initial_states.speed_mps[use]) / np.abs(predicted[use]))
    return out
