"""Nightly values: one number per night, condition and metric, and one for each trajectory."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.types import Floats
from agvbench.workflows.history.cells import KEYS, Codes, MetricCells

if TYPE_CHECKING:
    import pandas as pd

ALL = ""
"""The trajectory of values over all trajectories."""


@dataclass(frozen=True)
class Nights:
    """Nightly values of every series: a condition and metric with its unit.

    Parameters
    ----------
    series
        Condition, metric and unit of each series.
    trajectories
        Their names.
    repeats
        Runs that count, shape (series, trajectories, nights).
    median, spread
        Of the absolute values of repeats, in the unit of the series, of the same shape; NaN where there are none.
    """

    series: tuple[tuple[str, str, str], ...]
    trajectories: tuple[str, ...]
    repeats: Codes
    median: Floats
    spread: Floats

    @property
    def value(self) -> Floats:
        """The mean over trajectories of the medians of absolute values, shape (series, nights).

        A trajectory that a night lacks, as it does the others, takes the median of its other nights, shifted as those
        of the same night are: what is driven in one night alone makes no step.
        """
        typical = _over(np.nanmedian, self.median, axis=2)
        shift = _over(np.nanmean, self.median - typical[:, :, np.newaxis], axis=1)
        return np.asarray(_over(np.nanmean, typical, axis=1)[:, np.newaxis] + shift)

    @property
    def repeatability(self) -> Floats:
        """The standard deviation of repeats: root mean square over trajectories, shape (series, nights)."""
        return np.sqrt(_over(np.nanmean, self.spread**2, axis=1))

    def table(self) -> pd.DataFrame:
        """Return one row per night, series and trajectory, those over all trajectories first.

        Columns ``night`` (its number), ``condition``, ``metric``, ``unit``, ``trajectory`` ("" for all), ``repeats``,
        ``value``, ``repeatability`` (standard deviation of repeats), ``stderr``, the standard error of the value
        that the repeatability causes: a median of normal repeats has √(π/2) times that of their mean, and ``lacking``,
        how many trajectories of other nights this one lacks, whose value is estimated as `value` says.
        """
        import pandas as pd

        repeats = np.concatenate([self.repeats.sum(axis=1, keepdims=True), self.repeats], axis=1)
        value = np.concatenate([self.value[:, np.newaxis], self.median], axis=1)
        spread = np.concatenate([self.repeatability[:, np.newaxis], self.spread], axis=1)
        stderr = np.sqrt(np.pi / 2.0 / repeats.clip(1)) * spread
        is_lacking = (self.repeats == 0) & self.repeats.any(axis=2, keepdims=True)
        lacking = np.concatenate([is_lacking.sum(axis=1, keepdims=True), np.zeros_like(self.repeats)], axis=1)
        series, trajectory, night = np.nonzero(repeats)
        at = series, trajectory, night
        texts = {name: named([kind[k] for kind in self.series], series) for k, name in enumerate(KEYS[:3])}
        way = {"trajectory": named((ALL, *self.trajectories), trajectory)}
        numbers = {"repeats": repeats[at], "value": value[at], "repeatability": spread[at], "stderr": stderr[at]}
        numbers["lacking"] = lacking[at]
        return pd.DataFrame({"night": night} | texts | way | numbers)


def nights_of(campaigns: Sequence[MetricCells]) -> Nights:
    """Return the nightly values of campaigns in their order."""
    kinds, trajectories = dict[tuple[str, str, str], int](), dict[str, int]()
    places = [_places(cells, kinds, trajectories) for cells in campaigns]
    shape = len(kinds), len(trajectories), len(campaigns)
    repeats = np.zeros(shape, dtype=np.int64)
    median, spread = np.full((2, *shape), np.nan)
    for night, (cells, at) in enumerate(zip(campaigns, places, strict=True)):
        repeats[*at, night], median[*at, night], spread[*at, night] = cells.repeats, cells.median, cells.spread
    return Nights(tuple(kinds), tuple(trajectories), repeats, median, spread)


def _places(
    cells: MetricCells, kinds: dict[tuple[str, str, str], int], trajectories: dict[str, int]
) -> tuple[Codes, Codes]:
    """Return the numbers of each cell's series and trajectory, which are given as they appear."""
    shape = tuple(max(1, len(names)) for names in cells.names[:3])
    own, series = np.unique(np.ravel_multi_index(tuple(cells.codes[:3]), shape), return_inverse=True)
    conditions, metrics, units, ways = cells.names
    of_series = [
        kinds.setdefault((conditions[c], metrics[m], units[u]), len(kinds))
        for c, m, u in zip(*np.unravel_index(own, shape), strict=True)
    ]
    of_ways = {code: trajectories.setdefault(ways[code], len(trajectories)) for code in np.unique(cells.codes[3])}
    return np.array(of_series, dtype=np.int64)[series], np.array([of_ways[code] for code in cells.codes[3]], np.int64)


def _over(reduce: object, values: Floats, *, axis: int) -> Floats:
    """Return ``reduce(values, axis)``, NaN where there is no value."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="(Mean of empty|All-NaN) slice", category=RuntimeWarning)
        return np.asarray(reduce(values, axis=axis))  # type: ignore[operator]


def named(names: Sequence[str], codes: Codes) -> pd.Categorical[str]:
    """Return the name that each code numbers, as a column."""
    import pandas as pd

    distinct = pd.Index(dict.fromkeys(names))
    return pd.Categorical.from_codes(distinct.get_indexer(pd.Index(names))[codes], distinct)
