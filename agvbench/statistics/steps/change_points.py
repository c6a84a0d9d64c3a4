"""Steps in series of nightly values, with a stated chance of any false one over all series together.

The number of steps is chosen by penalised least squares (PELT; Killick, Fearnhead and Eckley 2012, Journal of the
American Statistical Association 107, 1590–1598), as `ruptures` computes it. The penalty is a quantile of the largest
gain in series without a step (`agvbench.statistics.steps.step_null`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.statistics.intervals import CONFIDENCE
from agvbench.statistics.steps.step_null import (
    autocorrelation,
    inflation,
    largest_gains,
    resolution,
    successive_variance,
)
from agvbench.types import Floats

FEWEST = 10
"""Nights that a series needs to be tested."""
SHORTEST = 3
"""Nights that a level lasts at least: a single night is an outlier, not a step."""
ORDERS = 199
_SHARE = 0.7
"""Of alpha, which the test uses: the estimate of the autocorrelation adds to the chance of a false step."""
_COMMON_SCALE = 0.9
"""The quantile that makes gains of series of different lengths and distributions comparable."""


@dataclass(frozen=True)
class ChangePoint:
    """A step of one series, between two nights; nights are numbered as the columns of the series.

    ``night`` is the first night after it, ``earliest`` and ``latest`` are the bounds of its 95 % interval, and
    ``last_before`` is the last night with a value before ``earliest``. ``before`` and ``after`` are the mean values of
    both levels in the unit of the series.
    """

    night: int
    earliest: int
    latest: int
    last_before: int
    before: float
    after: float

    @property
    def change(self) -> float:
        """Mean after minus mean before."""
        return self.after - self.before


@dataclass(frozen=True)
class ChangePoints:
    """The steps ``of`` each series in order, and what they were judged with.

    ``sd`` is the standard deviation of the nights of each series about their levels, shape (s,), NaN where a series
    has too few nights to be tested. ``autocorrelation`` is that of successive nights, over all series.
    """

    of: tuple[tuple[ChangePoint, ...], ...]
    sd: Floats
    autocorrelation: float


def find_steps(series: Floats, *, alpha: float, seed: int = 0) -> ChangePoints:
    """Return the steps of series of nightly values, shape (s, n), NaN where a night has none.

    Parameters
    ----------
    series
        Nights in the order in which they were driven.
    alpha
        The chance of any step in series without one, from 0.01. It holds whatever the distribution of the nights.
        With an autocorrelation of 0.3 it is about 6 % at a level of 5 %, with 0.5 about 12 %.
    seed
        Of the random orders of nights: the same series and seed give the same steps.
    """
    kept = [values[np.isfinite(values)] for values in series]
    long = [k for k, values in enumerate(kept) if len(values) >= FEWEST]
    tested = [k for k in long if np.ptp(kept[k]) > resolution(kept[k])]
    sd, of = np.full(len(series), np.nan), [tuple[ChangePoint, ...]()] * len(series)
    sd[long] = 0.0
    if not tested:
        return ChangePoints(tuple(of), sd, 0.0)
    correlation = autocorrelation([kept[k] for k in tested])
    long_run = float(inflation(correlation))
    for k, stepped, penalty in zip(tested, *_tested(series[tested], correlation, alpha, seed), strict=True):
        variance = long_run * max(successive_variance(kept[k], 1), resolution(kept[k]) ** 2)
        breaks = _breaks(kept[k], float(penalty) * variance) if stepped else []
        sd[k] = _about_levels(kept[k], breaks)
        of[k] = tuple(_steps(kept[k], np.flatnonzero(np.isfinite(series[k])), breaks, variance))
    return ChangePoints(tuple(of), sd, correlation)


def _tested(series: Floats, correlation: float, alpha: float, seed: int) -> tuple[NDArray[np.bool_], Floats]:
    """Return which series have a step, and the penalty of one in units of the long-run variance; both of shape (s,).

    A permutation test of the largest gain over all series: the recorded order of nights is one of the orders.
    """
    n = series.shape[1]
    orders = np.argsort(np.random.default_rng(seed).random((ORDERS, n)), axis=1)
    gains = largest_gains(series, correlation, np.vstack([np.arange(n), orders]), SHORTEST)
    scale = np.quantile(gains, _COMMON_SCALE, axis=0)
    largest = np.sort(np.max(gains / scale, axis=1))
    limit = scale * largest[math.ceil((ORDERS + 1) * (1.0 - _SHARE * alpha)) - 1]
    return gains[0] > limit, limit


def _breaks(values: Floats, penalty: float) -> list[int]:
    """Return where levels of `values`, shape (n,), begin after the first."""
    from ruptures import KernelCPD

    model = KernelCPD(kernel="linear", min_size=SHORTEST).fit((values - values.mean())[:, np.newaxis])
    return [int(at) for at in model.predict(pen=penalty)[:-1]]


def _about_levels(values: Floats, breaks: Sequence[int]) -> float:
    """Return the standard deviation of `values`, shape (n,), about their levels; 0 if it is that of rounding."""
    squares = sum(float(np.var(level)) * len(level) for level in np.split(values, breaks))
    sd = math.sqrt(squares / (len(values) - len(breaks) - 1))
    return sd if sd > resolution(values) else 0.0


def _steps(values: Floats, nights: NDArray[np.int64], breaks: Sequence[int], variance: float) -> Iterator[ChangePoint]:
    """Yield the steps at `breaks` of the values at `nights`, both of shape (n,)."""
    edges = [0, *breaks, len(values)]
    for (first, at), (_, end) in pairwise(pairwise(edges)):
        low, high = _interval(values[first:end], variance)
        yield ChangePoint(
            night=int(nights[at]),
            earliest=int(nights[first + low]),
            latest=int(nights[first + high]),
            last_before=int(nights[first + low - 1]),
            before=float(values[first:at].mean()),
            after=float(values[at:end].mean()),
        )


def _interval(values: Floats, variance: float) -> tuple[int, int]:
    """Return between which values the later of two levels of `values` begins, at 95 %.

    The bounds of the smallest set of places with 95 % of the posterior probability, with a flat prior of the place and
    of both levels; `variance` is the long-run one.
    """
    n = len(values)
    place = np.arange(1, n)
    removed = (np.cumsum(values - values.mean())[:-1]) ** 2 * n / (place * (n - place))
    log_weight = removed / (2.0 * variance) - 0.5 * np.log(place * (n - place))
    weight = np.exp(log_weight - log_weight.max())
    order = np.argsort(-weight, kind="stable")
    count = int(np.searchsorted(np.cumsum(weight[order]), CONFIDENCE * weight.sum())) + 1
    likely = place[order[:count]]
    return int(likely.min()), int(likely.max())
