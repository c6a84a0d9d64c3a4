"""How large the gain of a step is in series without one: the same nights in random order, with their autocorrelation.

The gain of a step is the sum of squares that two levels instead of one remove, that of a window is half the sum that a
level of its own removes. Both are divided by the long-run variance of the series.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agvbench.compiled import cached_njit
from agvbench.types import Floats

LARGEST_AUTOCORRELATION = 0.8
_RESOLUTION = 1e-6
"""Of a series, relative to its largest value."""
_WINDOWS_GROW = 1.6
_KEPT, _OF_NORMAL = 0.9, 0.6230
"""The share of squares that count, and the mean of that share of the squares of standard normal values."""
Orders = NDArray[np.int64]


@cached_njit()
def successive_variance(values: Floats, apart: int) -> float:  # pragma: no cover - compiled
    """Return half the mean square of the differences of values `apart`, of shape (n,), without the largest tenth.

    Steps are among the tenth that is left out; what remains is divided by its share in normal values.
    """
    squares = (values[apart:] - values[:-apart]) ** 2
    count = max(1, int(_KEPT * len(squares)))
    return float(np.mean(np.partition(squares, count - 1)[:count])) / (2.0 * _OF_NORMAL)


def autocorrelation(series: Sequence[Floats]) -> float:
    """Return the autocorrelation of successive values, in 0…0.8: the median over series of shapes (n,).

    In an autoregressive series of order 1, the mean square differences over two values and over one have the ratio
    1 + ρ.
    """
    variances = [(successive_variance(values, 1), successive_variance(values, 2)) for values in series]
    ratios = [twice / once for once, twice in variances if once > 0.0]
    return float(np.clip(np.median(ratios) - 1.0, 0.0, LARGEST_AUTOCORRELATION)) if ratios else 0.0


def inflation(correlation: float | Floats) -> Floats:
    """Return the long-run variance of autoregressive series in units of their `successive_variance`."""
    return np.asarray((1.0 + correlation) / (1.0 - correlation) ** 2)


def resolution(values: Floats) -> float:
    """Return the difference below which values are equal but for rounding, as those of repeated simulations are."""
    return _RESOLUTION * float(np.max(np.abs(values)))


def largest_gains(series: Floats, correlation: float, orders: Orders, shortest: int) -> Floats:
    """Return the largest gain in each series without a step, for each order of nights, shape (orders, s).

    Parameters
    ----------
    series
        Nightly values, shape (s, n), NaN where a night has none.
    correlation
        Autocorrelation of the series.
    orders
        Permutations of the nights, shape (orders, n): one for all series, whose nights stay together.
    shortest
        Nights that a level lasts at least.
    """
    scaled, ratios = np.empty((2, len(orders), len(series)))
    for k, values in enumerate(series):
        seen = np.isfinite(values)
        places = (np.cumsum(seen) - 1)[orders[seen[orders]].reshape(len(orders), -1)]
        windows = _window_lengths(int(seen.sum()), shortest)
        added, least = _innovations(values[seen], correlation), resolution(values[seen]) ** 2
        scaled[:, k], ratios[:, k] = _gains(added, correlation, places, windows, least)
    shown = np.clip(np.median(ratios, axis=1) - 1.0, 0.0, LARGEST_AUTOCORRELATION)
    return np.asarray(scaled / inflation(shown)[:, np.newaxis])


def _innovations(values: Floats, correlation: float) -> Floats:
    """Return what an autoregressive series adds to its past, with the variance of an innovation."""
    about = values - values.mean()
    first = about[:1] * np.sqrt(1.0 - correlation**2)
    return np.concatenate([first, about[1:] - correlation * about[:-1]])


def _window_lengths(n: int, shortest: int) -> NDArray[np.int64]:
    longest = max(shortest, n // 2)
    count = int(np.log(longest / shortest) / np.log(_WINDOWS_GROW)) + 2
    return np.unique(np.geomspace(shortest, longest, count).astype(np.int64))


@cached_njit()
def _gains(
    innovations: Floats, correlation: float, orders: Orders, windows: NDArray[np.int64], least: float
) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Return the largest gain over `successive_variance`, and the ratio of `autocorrelation`, of each order.

    A variance below `least` is that of rounding.
    """
    n, shortest = orders.shape[1], windows[0]
    gains, ratios = np.zeros(len(orders)), np.zeros(len(orders))
    sums, y = np.zeros(n + 1), np.zeros(n)
    for row in range(len(orders)):
        for t in range(n):
            added = innovations[orders[row, t]]
            y[t] = added / np.sqrt(1.0 - correlation**2) if t == 0 else correlation * y[t - 1] + added
            sums[t + 1] = sums[t] + y[t]
        mean, best = sums[n] / n, 0.0
        for k in range(shortest, n - shortest + 1):
            best = max(best, (sums[k] - k * mean) ** 2 * n / (k * (n - k)))
        for length in windows:
            for first in range(shortest, n - length - shortest + 1):
                off = sums[first + length] - sums[first] - length * mean
                best = max(best, 0.5 * off * off * n / (length * (n - length)))
        once = max(successive_variance(y, 1), least)
        gains[row], ratios[row] = best / once, max(successive_variance(y, 2), least) / once
    return gains, ratios
