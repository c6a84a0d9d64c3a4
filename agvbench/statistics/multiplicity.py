"""Many comparisons at once: Holm's correction, not charged for comparisons that could not have spoken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm(p_values: Sequence[float]) -> list[float]:
    """Return Holm's (1979) adjusted p-values, in the order given.

    Rejecting where the adjusted value is at most α keeps the chance of any false rejection at or below α, whatever
    the dependence.

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return [float(value) for value in adjusted]


def can_speak(least_p: Sequence[float], alpha: float) -> list[bool]:
    """Return which tests could reach significance at all after correction (Tarone, 1990).

    A test of few repeats has a smallest possible p-value. Tests whose smallest is above α / k, with k the least
    number for which at most k tests are not, are left out: they cannot be false alarms, so the others need not pay
    for them.

    >>> can_speak([0.2, 0.2, 0.001], alpha=0.05)
    [False, False, True]
    """
    least = np.asarray(least_p, dtype=float)
    k = next((k for k in range(1, len(least) + 1) if np.sum(least <= alpha / k) <= k), 1)
    return [bool(value <= alpha / k) for value in least]


def holm_of_those_that_can_speak(p_values: Sequence[float], least_p: Sequence[float], alpha: float) -> list[float]:
    """Return Holm's adjusted p-values among the tests that `can_speak`; 1 for the others."""
    spoken = can_speak(least_p, alpha)
    adjusted = iter(holm([p for p, able in zip(p_values, spoken, strict=True) if able]))
    return [next(adjusted) if able else 1.0 for able in spoken]
