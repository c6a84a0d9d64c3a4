"""Test for a periodic disturbance of random phase in each run, such as the run-out of an eccentric wheel."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.residuals.body_rates import FEATURES, Rates
from agvbench.diagnosis.residuals.covariate_test import RANDOM_PHASE, Dependence
from agvbench.types import Floats

_PERIODS_M = np.geomspace(0.15, 1.0, 48)
_PERMUTATIONS, _MIN_STEPS, _STEPS_PER_PERIOD, _MIN_SHARE = 999, 12, 1.6, 0.3
_WINSOR_LIMIT = 3.0  # times the median run


def periodic_disturbance(rates: Rates, group: NDArray[np.int64], seed: int) -> Dependence | None:
    """Return the dependence on the distance modulo a period with a random phase in each run, or None.

    An eccentric wheel causes a periodic disturbance of speed and curvature, once per revolution, with a random initial
    phase. After removal of a linear trend, a sinusoid with its own phase is fitted to each run. The period is the one
    that explains the largest share of the variance of all runs together. Its p-value comes from permuted samples.
    Differences of noisy poses alone explain about a tenth, so that a larger share is required. The mean of the repeats
    of a ``group`` (R,) is subtracted before, because it has no random phase.
    """
    rng = np.random.default_rng([0x5F15, seed])
    best: Dependence | None = None
    for feature in ("speed", "turning"):
        series = _winsorised([_detrended(*contrast) for contrast in _contrasts(rates, feature, group)])
        total = sum(float(value @ value) for value, _ in series)
        if total <= 0.0:
            continue
        size = np.sum([_explained(value[None, :], waves)[0] for value, waves in series], axis=0)
        # A sinusoid has two degrees of freedom, which explain their share of any samples.
        share = (size - 2.0 * sum(float(value @ value) / len(value) for value, _ in series)) / total
        period = int(np.argmax(share))
        if share[period] < max(_MIN_SHARE, best.share if best else 0.0):
            continue
        permuted = np.zeros((_PERMUTATIONS, len(_PERIODS_M)))
        for value, waves in series:
            permuted += _explained(rng.permuted(np.tile(value, (_PERMUTATIONS, 1)), axis=1), waves)
        p_value = (1.0 + float(np.count_nonzero(permuted.max(axis=1) >= size[period]))) / (_PERMUTATIONS + 1.0)
        best = Dependence(RANDOM_PHASE, feature, p_value, float(share[period]))
    return best if best is not None and best.p_value < RESIDUAL.periodic_alpha else None


def _contrasts(rates: Rates, feature: str, group: NDArray[np.int64]) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Yield distance, weight and value (k,) of differences between repeats, one series fewer than runs per group.

    Each series is a Helmert contrast of the runs at the same steps. Sinusoids of one period in the runs remain a
    sinusoid of that period in the contrast.
    """
    value, distance = rates.value[:, FEATURES.index(feature)], rates.covariates["distance_m"]
    for g in np.unique(group):
        rows = [np.flatnonzero(rates.run == run) for run in np.flatnonzero(group == g)]
        rows = [own for own in rows if len(own) >= _MIN_STEPS]
        if len(rows) < 2:
            continue
        steps = reduce(np.intersect1d, [rates.step[own] for own in rows])
        if len(steps) < _MIN_STEPS:
            continue
        rows = [own[np.isin(rates.step[own], steps)] for own in rows]
        values = np.array([value[own] for own in rows])
        for n in range(1, len(rows)):
            own = rows[n]
            yield distance[own], rates.weight[own], (values[:n].mean(axis=0) - values[n]) * np.sqrt(n / (n + 1.0))


def _winsorised(series: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
    """Winsorise the variance of the series: a wheel disturbs all runs, and a few outliers must not decide."""
    size = np.array([float(value @ value) for value, _ in series])
    most = _WINSOR_LIMIT * float(np.median(size)) if len(size) else 0.0
    return [
        (value * np.sqrt(most / s) if s > most else value, waves)
        for (value, waves), s in zip(series, size, strict=True)
    ]


def _detrended(distance: Floats, weight: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return a series (n,) without its linear trend, and orthonormal sinusoids (n, 2, periods) of every period.

    Sinusoids of periods that the steps do not resolve are zero.
    """
    line, _ = np.linalg.qr(np.column_stack([weight, weight * distance]))
    weighted = weight * value
    angle = 2.0 * np.pi * distance[:, None] / _PERIODS_M
    resolved = _STEPS_PER_PERIOD * float(np.median(weight)) <= _PERIODS_M
    cosine, sine = (_orthogonal(wave * weight[:, None], line) for wave in (np.cos(angle), np.sin(angle)))
    first = _normalised(cosine)
    second = _normalised(sine - first * np.sum(first * sine, axis=0))
    return weighted - line @ (line.T @ weighted), np.stack([first, second], axis=1) * resolved


def _orthogonal(columns: Floats, line: Floats) -> Floats:
    return np.asarray(columns - line @ (line.T @ columns))


def _normalised(columns: Floats) -> Floats:
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def _explained(rows: Floats, waves: Floats) -> Floats:
    """Return the sum of squares of each row that sinusoids of each period explain (rows, periods)."""
    return np.asarray(((rows @ waves[:, 0]) ** 2) + (rows @ waves[:, 1]) ** 2)
