"""Swings with a phase of their own in each run, as an eccentric wheel makes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.dependences import RANDOM_PHASE, Dependence
from agvbench.diagnosis.residual_rates import FEATURES, Rates
from agvbench.types import Floats

_SWINGS_M = np.geomspace(0.15, 1.0, 48)
_SHUFFLES, _LEAST_STEPS, _STEPS_PER_SWING, _LEAST_SWING = 999, 12, 1.6, 0.3
_LOUDEST = 3.0  # times the median run
_SWING_ALPHA = 5e-3  # as many shuffles resolve


def swing(rates: Rates, group: NDArray[np.int64], seed: int) -> Dependence | None:
    """Return the dependence on the distance modulo a period whose phase differs from run to run, if there is one.

    An eccentric wheel swings speed and course once per turn, from wherever it happens to stand. In each run a wave
    with a phase of its own is fitted to what a straight line leaves; what waves explain of all runs together shows the
    period, and shuffled samples how much of it is chance. Differences of noisy poses swing a little by themselves (a
    tenth), so the share has to be large. What repeats (of one ``group``, (R,)) have in common has no phase of its own,
    whatever its shape, and is taken off before.
    """
    rng = np.random.default_rng([0x5F15, seed])
    counts = np.bincount(rates.run, minlength=len(group))
    repeated = np.bincount(group, weights=counts >= _LEAST_STEPS)[group] > 1
    runs = [rates.run == run for run in np.flatnonzero((counts >= _LEAST_STEPS) & repeated)]
    best: Dependence | None = None
    for feature in ("speed", "turning"):
        value = _of_its_own(rates.value[:, FEATURES.index(feature)], rates.run, group)
        rests = _none_too_loud(
            [_bent(rates.covariates["distance_m"][own], rates.weight[own], value[own]) for own in runs]
        )
        total = sum(float(rest @ rest) for rest, _ in rests)
        if total <= 0.0:
            continue
        size = np.sum([_explained(rest[None, :], waves)[0] for rest, waves in rests], axis=0)
        # A wave takes two numbers of a run's samples whatever they are.
        share = (size - 2.0 * sum(float(rest @ rest) / len(rest) for rest, _ in rests)) / total
        period = int(np.argmax(share))
        if share[period] < max(_LEAST_SWING, best.share if best else 0.0):
            continue
        chance = np.zeros((_SHUFFLES, len(_SWINGS_M)))
        for rest, waves in rests:
            chance += _explained(rng.permuted(np.tile(rest, (_SHUFFLES, 1)), axis=1), waves)
        p_value = (1.0 + float(np.count_nonzero(chance.max(axis=1) >= size[period]))) / (_SHUFFLES + 1.0)
        best = Dependence(RANDOM_PHASE, feature, p_value, float(share[period]))
    return best if best is not None and best.p_value < _SWING_ALPHA else None


def _of_its_own(value: Floats, run: NDArray[np.int64], group: NDArray[np.int64]) -> Floats:
    """Return what each run has (n,) beyond the mean of its group's runs at the same step."""
    first = np.searchsorted(run, run)  # the samples of a run lie together
    _, place = np.unique(np.column_stack([group[run], np.arange(len(run)) - first]), axis=0, return_inverse=True)
    count = np.bincount(place)[place]
    mean = np.bincount(place, weights=value)[place] / count
    return np.where(count > 1, (value - mean) * np.sqrt(count / np.maximum(count - 1, 1)), 0.0)


def _none_too_loud(rests: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
    """Return what is left of the runs, the loudest turned down: a wheel swings in all of them, and not in a few."""
    size = np.array([float(rest @ rest) for rest, _ in rests])
    most = _LOUDEST * float(np.median(size)) if len(size) else 0.0
    return [
        (rest * np.sqrt(most / s) if s > most else rest, waves) for (rest, waves), s in zip(rests, size, strict=True)
    ]


def _bent(distance: Floats, weight: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return what a straight line leaves of one run, and orthonormal waves (n, 2, periods) of every period.

    Waves of periods that its steps do not resolve are zero.
    """
    line, _ = np.linalg.qr(np.column_stack([weight, weight * distance]))
    rest = weight * value
    angle = 2.0 * np.pi * distance[:, None] / _SWINGS_M
    resolved = _STEPS_PER_SWING * float(np.median(weight)) <= _SWINGS_M
    cosine, sine = (_apart(wave * weight[:, None], line) for wave in (np.cos(angle), np.sin(angle)))
    first = _normal(cosine)
    second = _normal(sine - first * np.sum(first * sine, axis=0))
    return rest - line @ (line.T @ rest), np.stack([first, second], axis=1) * resolved


def _apart(columns: Floats, line: Floats) -> Floats:
    return np.asarray(columns - line @ (line.T @ columns))


def _normal(columns: Floats) -> Floats:
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def _explained(rows: Floats, waves: Floats) -> Floats:
    """Return what waves of each period explain of each row (rows, periods)."""
    return np.asarray(((rows @ waves[:, 0]) ** 2) + (rows @ waves[:, 1]) ** 2)
