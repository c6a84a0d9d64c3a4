"""Group-sequential tests: one-sided p-values that stay valid where data are analysed again after every round.

An error-spending function says how much of a level may be used up to an analysis (Lan and DeMets 1983, Biometrika 70,
659–663). The bounds that use exactly this much follow by recursive numerical integration (Armitage, McPherson and Rowe
1969; Jennison and Turnbull 2000, chapter 19). The sequential p-value is the smallest level at which the test would have
rejected at one of the analyses so far (Liu and Anderson 2008, JASA 103, 1621–1630): it can be held against a level, and
corrected for other comparisons, at any time (Maurer and Bretz 2013).

A rank-sum statistic of a fixed sample against a growing one has the joint distribution that the recursion assumes. With
n_a values on one side and k ≤ l on the other, the correlation of its values at both analyses is
√(k (n_a + l + 1) / (l (n_a + k + 1))), which is the square root of the ratio of `rank_sum_information`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from agvbench.types import Floats

Schedule = tuple[tuple[float, float], ...]
"""For each analysis its information (any unit, not falling), and the share of the level that may be spent by then."""

_LOWEST_Z = -6.0
_HIGHEST_Z = 9.0
_NODES = 256
"""Of the quadrature: their distance is below half the standard deviation of an increment of 1 % of the information."""
_LEVEL_Z = np.arange(0.0, 5.6, 0.15)
"""Levels from 0.5 to 1.6e-8 as normal quantiles; between them bounds are interpolated in these quantiles."""
_BISECTIONS = 50


class Spending(StrEnum):
    """How a level is spent over the information: hardly at first, by its third power, or evenly from the beginning."""

    OBRIEN_FLEMING = "O'Brien-Fleming"
    CUBIC = "cubic"
    POCOCK = "Pocock"


def rank_sum_information(n_a: int, n_b: int) -> float:
    """Return the information of a rank-sum test, up to a factor: n_a n_b / (n_a + n_b + 1).

    It grows with `n_b` towards `n_a`: more repeats of one side alone do not compensate for few of the other.

    >>> rank_sum_information(10, 10), rank_sum_information(10, 0)
    (4.761904761904762, 0.0)
    """
    return n_a * n_b / (n_a + n_b + 1)


def spent(level: Floats, share: float, spending: Spending) -> Floats:
    """Return how much of each one-sided `level` may be spent at this `share` of the planned information.

    Lan and DeMets (1983): 2 − 2 Φ(z / √share) with the quantile z of level / 2 (O'Brien and Fleming's kind), and
    level · ln(1 + (e − 1) share) (Pocock's). Kim and DeMets (1987, Biometrika 74, 149–154): level · share³ (cubic).

    >>> spent(np.array([0.025]), 1.0, Spending.OBRIEN_FLEMING).round(6).tolist()
    [0.025]
    """
    from scipy.special import ndtr, ndtri

    share = min(max(share, 0.0), 1.0)
    if share == 0.0:
        return np.zeros_like(level)
    if spending is Spending.POCOCK:
        return np.asarray(level * np.log1p((np.e - 1.0) * share))
    if spending is Spending.CUBIC:
        return np.asarray(level * share**3)
    return np.asarray(2.0 * ndtr(ndtri(level / 2.0) / np.sqrt(share)))


@dataclass(frozen=True)
class _Reached:
    """After an analysis: its information, what each level has spent, and the paths that have not crossed.

    ``bound`` (levels,) is the critical z; ``score`` and ``mass`` (levels, nodes) are quadrature nodes of the score
    z √information below the bound, and the probability at each.
    """

    information: float
    spent: Floats
    bound: Floats
    score: Floats
    mass: Floats


@lru_cache(maxsize=256)
def _reached(schedule: Schedule, spending: Spending, levels: tuple[float, ...]) -> _Reached:
    before = _reached(schedule[:-1], spending, levels) if len(schedule) > 1 else _nothing(len(levels))
    information, share = schedule[-1]
    target = np.maximum(spent(np.array(levels), share, spending), before.spent)
    if information <= before.information:  # nothing new was measured: this analysis spends nothing
        return _Reached(before.information, before.spent, np.full(len(levels), np.inf), before.score, before.mass)
    bound = _bound(before, information, target - before.spent)
    return _Reached(information, target, bound, *_below(before, information, bound))


def _nothing(levels: int) -> _Reached:
    zeros = np.zeros((levels, 1))
    return _Reached(0.0, np.zeros(levels), np.zeros(levels), zeros, zeros + 1.0)


def _exceeding(before: _Reached, information: float, z: Floats) -> Floats:
    """Return the probability of no crossing before and a value above `z` (levels,) now."""
    from scipy.special import ndtr

    sd = np.sqrt(information - before.information)
    away = (before.score - (z * np.sqrt(information))[:, None]) / sd
    return np.asarray((before.mass * ndtr(away)).sum(axis=1))


def _bound(before: _Reached, information: float, allowed: Floats) -> Floats:
    """Return the critical z (levels,) that is exceeded now, and not before, with the probabilities `allowed`."""
    low, high = np.full(len(allowed), _LOWEST_Z), np.full(len(allowed), _HIGHEST_Z)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        too_low = _exceeding(before, information, middle) > allowed
        low, high = np.where(too_low, middle, low), np.where(too_low, high, middle)
    return high


def _below(before: _Reached, information: float, bound: Floats) -> tuple[Floats, Floats]:
    """Return nodes of the score below `bound` and the probability at each, of paths that never crossed."""
    nodes, weights = _quadrature()
    half = (bound - _LOWEST_Z)[:, None] / 2.0
    score = (_LOWEST_Z + half * (nodes + 1.0)) * np.sqrt(information)
    sd = np.sqrt(information - before.information)
    mass = np.empty_like(score)
    for k in range(len(bound)):  # one level at a time: all together would need a hundred megabytes
        z = (score[k][:, None] - before.score[k]) / sd
        mass[k] = np.exp(-0.5 * z * z) @ before.mass[k]
    return score, mass * weights * half * np.sqrt(information) / (sd * np.sqrt(2.0 * np.pi))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    return nodes, weights


def critical_values(schedule: Schedule, level: float, spending: Spending) -> Floats:
    """Return the critical z of every analysis, shape (analyses,): the test rejects where z exceeds it.

    Parameters
    ----------
    schedule
        Information and share of the level that may be spent, for each analysis.
    level
        One-sided: the probability of exceeding any of the values if nothing differs.

    Examples
    --------
    Five analyses at equal steps and 2.5 %, as published for the spending function of O'Brien and Fleming's kind:

    >>> steps = tuple((k / 5, k / 5) for k in range(1, 6))
    >>> critical_values(steps, 0.025, Spending.OBRIEN_FLEMING).round(2).tolist()
    [4.88, 3.36, 2.68, 2.29, 2.03]
    """
    made = [_reached(schedule[: k + 1], spending, (level,)) for k in range(len(schedule))]
    return np.array([float(reached.bound[0]) for reached in made])


def crossing_probability(information: Sequence[float], critical: Sequence[float], shift: float = 0.0) -> float:
    """Return the probability that z exceeds its critical value in one of the analyses.

    ``shift`` is the mean of z for an information of 1; it grows with the square root of the information.
    """
    state, crossed = _nothing(1), 0.0
    for now, bound in zip(information, critical, strict=True):
        drifted = _Reached(
            state.information, state.spent, state.bound, state.score + shift * (now - state.information), state.mass
        )
        z = np.array([bound])
        crossed += float(_exceeding(drifted, now, z)[0])
        state = _Reached(now, state.spent, z, *_below(drifted, now, z))
    return crossed


def sequential_p(p_values: Sequence[float], schedule: Schedule, spending: Spending) -> float:
    """Return the sequential p-value after analyses with these one-sided `p_values`; 1 where it is above 0.5.

    If nothing differs, it falls to u or below in any of the analyses with probability u at most.

    Parameters
    ----------
    p_values
        Of the test at each analysis by itself.
    schedule
        Information and share that may be spent, for each analysis.

    Examples
    --------
    >>> steps = tuple((k / 5, k / 5) for k in range(1, 6))
    >>> round(sequential_p([0.4, 0.2, 0.01, 0.3], steps[:4], Spending.OBRIEN_FLEMING), 3)
    0.048
    """
    tables = [sequential_p_table(schedule[: k + 1], spending) for k in range(len(schedule))]
    found = [float(level_of(np.array([p]), *table)[0]) for p, table in zip(p_values, tables, strict=True)]
    return min(found, default=1.0)


def sequential_p_table(schedule: Schedule, spending: Spending) -> tuple[Floats, Floats]:
    """Return one-sided levels as normal quantiles, and the critical z at the last analysis of `schedule` for each."""
    from scipy.special import ndtr

    reached = _reached(schedule, spending, tuple(ndtr(-_LEVEL_Z).tolist()))
    return _LEVEL_Z, reached.bound


def level_of(p_values: Floats, level_z: Floats, critical_z: Floats) -> Floats:
    """Return for each one-sided p-value of one analysis the smallest level whose bound it crosses, 1 above 0.5."""
    from scipy.special import ndtr, ndtri

    z = -ndtri(np.clip(p_values, 1e-300, 1.0))
    level = ndtr(-np.interp(z, critical_z, level_z))
    return np.where(z < critical_z[0], 1.0, level)
