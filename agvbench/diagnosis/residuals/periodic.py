"""Periodic disturbances with a phase of their own in each run, as an eccentric wheel makes them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.residuals.body_rates import FEATURES, Rates
from agvbench.diagnosis.residuals.covariate_test import RANDOM_PHASE, Dependence
from agvbench.types import Floats

_PERIODS_M = np.geomspace(0.15, 1.0, 48)
_SHUFFLES, _LEAST_STEPS, _STEPS_PER_PERIOD, _LEAST_AMPLITUDE = 999, 12, 1.6, 0.3
_WINSOR_LIMIT = 3.0  # times the median run
_PERIODIC_ALPHA = 5e-3  # as many shuffles resolve


def periodic_disturbance(rates: Rates, group: NDArray[np.int64], seed: int) -> Dependence | None:
    """Return the dependence on the distance modulo a period whose phase differs from run to run, if there is one.

    An eccentric wheel varies speed and course once per turn, from wherever it happens to stand. In each run a wave
    with a phase of its own is fitted to what a straight line leaves; what waves explain of all runs together shows the
    period, and shuffled samples how much of it is chance. Differences of noisy poses oscillate by themselves (a tenth),
        so the share has to be large. What repeats (of one ``group``, (R,)) have in common has no phase of its own,
    whatever its shape, and is taken off before.
    """
    rng = np.random.default_rng([0x5F15, seed])
    best: Dependence | None = None
    for feature in ("speed", "turning"):
        rests = _winsorised([_bent(*contrast) for contrast in _contrasts(rates, feature, group)])
        total = sum(float(rest @ rest) for rest, _ in rests)
        if total <= 0.0:
            continue
        size = np.sum([_explained(rest[None, :], waves)[0] for rest, waves in rests], axis=0)
        # A wave takes two numbers of a run's samples whatever they are.
        share = (size - 2.0 * sum(float(rest @ rest) / len(rest) for rest, _ in rests)) / total
        period = int(np.argmax(share))
        if share[period] < max(_LEAST_AMPLITUDE, best.share if best else 0.0):
            continue
        chance = np.zeros((_SHUFFLES, len(_PERIODS_M)))
        for rest, waves in rests:
            chance += _explained(rng.permuted(np.tile(rest, (_SHUFFLES, 1)), axis=1), waves)
        p_value = (1.0 + float(np.count_nonzero(chance.max(axis=1) >= size[period]))) / (_SHUFFLES + 1.0)
        best = Dependence(RANDOM_PHASE, feature, p_value, float(share[period]))
    return best if best is not None and best.p_value < _PERIODIC_ALPHA else None


def _contrasts(rates: Rates, feature: str, group: NDArray[np.int64]) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Yield distance, weight and value (k,) of what repeats do not share: for each group one series less than runs.

    Each is a Helmert contrast of the runs at the same steps: waves of one period in them are one wave of that period.
    """
    value, distance = rates.value[:, FEATURES.index(feature)], rates.covariates["distance_m"]
    for g in np.unique(group):
        rows = [np.flatnonzero(rates.run == run) for run in np.flatnonzero(group == g)]
        rows = [own for own in rows if len(own) >= _LEAST_STEPS]
        if len(rows) < 2:
            continue
        steps = reduce(np.intersect1d, [rates.step[own] for own in rows])
        if len(steps) < _LEAST_STEPS:
            continue
        rows = [own[np.isin(rates.step[own], steps)] for own in rows]
        values = np.array([value[own] for own in rows])
        for n in range(1, len(rows)):
            own = rows[n]
            yield distance[own], rates.weight[own], (values[:n].mean(axis=0) - values[n]) * np.sqrt(n / (n + 1.0))


def _winsorised(rests: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
    """Return what is left of the runs, winsorised: an eccentric wheel shows in all of them, and not in a few."""
    size = np.array([float(rest @ rest) for rest, _ in rests])
    most = _WINSOR_LIMIT * float(np.median(size)) if len(size) else 0.0
    return [
        (rest * np.sqrt(most / s) if s > most else rest, waves) for (rest, waves), s in zip(rests, size, strict=True)
    ]


def _bent(distance: Floats, weight: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return what a straight line leaves of one run, and orthonormal waves (n, 2, periods) of every period.

    Waves of periods that its steps do not resolve are zero.
    """
    line, _ = np.linalg.qr(np.column_stack([weight, weight * distance]))
    rest = weight * value
    angle = 2.0 * np.pi * distance[:, None] / _PERIODS_M
    resolved = _STEPS_PER_PERIOD * float(np.median(weight)) <= _PERIODS_M
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
