"""Columns that a lab logged beside the campaign's own, as covariates: numbers and texts of runs, numbers of poses.

They come from outside. Whatever a column contains, it is used or left out for a reason that the provenance states.
"""

from __future__ import annotations

import numbers
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.tables.schema import LONGEST_NAME, can_name_column
from agvbench.diagnosis.criteria import LOGGED
from agvbench.types import Floats, Run, TimeSeries

RUN_ORDER = "run_order"
COMPUTED = frozenset({
    "x_m", "y_m", "heading_rad", "course_rad", "time_in_run_s", "campaign_time_h", "speed_mps", "direction",
    "curvature_per_m", "sideslip", "distance_m", "distance_modulo_period_m", "history", "turned_rad",
    "session", RUN_ORDER,
})  # fmt: skip
"""Covariates that every diagnosis has: a logged column of such a name would be taken for it."""

_CONTROL = ("controller", "control_period_s", "controller_delay_s", "controller_compute_s")
_WRITTEN = frozenset({"duration_s", "events", "safety_stop", "source", "source_row", "command_hold_s", *_CONTROL})
_WRITTEN_PREFIX = "placing_"
_FIRMWARE = "firmware"
_IDENTIFIERS = ("id", "uuid", "_id", "_uuid")
_LARGEST_NUMBER, _STATED_AS_LEFT_OUT = 1e100, 50
_CONSTANT, _SAME = 1e-9, 0.9999


@dataclass(frozen=True)
class LoggedColumn:
    """One column: ``values`` (R, K + 1) at the start and at the samples of each run, NaN where missing.

    A text has ``levels``, and its values are their numbers. ``before`` (R, J) are values before a window begins.
    """

    name: str
    values: Floats
    levels: tuple[str, ...] = ()
    before: Floats | None = None

    @property
    def per_run(self) -> Floats:
        """The mean of each run, or before each window, (R,), NaN where there is no value."""
        values = self.values if self.before is None else self.before
        known = np.isfinite(values)
        total = np.where(known, values, 0.0).sum(axis=1)
        return np.asarray(np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan))

    def select(self, chosen: NDArray[np.int64]) -> LoggedColumn:
        """Return the column of the `chosen` runs (indices)."""
        before = None if self.before is None else self.before[chosen]
        return replace(self, values=self.values[chosen], before=before)


@dataclass(frozen=True)
class Regressor:
    """A number per run, standardised by ``mean`` and ``deviation``; of a text, whether it has the ``level``."""

    column: str
    level: str | None
    mean: float
    deviation: float


@dataclass(frozen=True)
class LoggedColumns:
    """The columns that are covariates, and those ``left_out`` with the reason.

    ``regressors`` are S numbers per run, and ``matrix`` (R, S) has their standardised values, 0 where they are missing.
    """

    columns: tuple[LoggedColumn, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    regressors: tuple[Regressor, ...] = ()
    matrix: Floats | None = None

    def select(self, chosen: NDArray[np.int64]) -> LoggedColumns:
        """Return the columns of the `chosen` runs (indices), standardised as those of all runs."""
        if self.matrix is None:
            return self
        columns = tuple(column.select(chosen) for column in self.columns)
        return replace(self, columns=columns, matrix=self.matrix[chosen])

    def standardised(self, runs: int) -> Floats:
        """Return the standardised regressors of the `runs` runs (R, S)."""
        return np.zeros((runs, 0)) if self.matrix is None else self.matrix

    @property
    def texts(self) -> Floats:
        """The standardised regressors of texts only (R, T)."""
        chosen = [k for k, regressor in enumerate(self.regressors) if regressor.level is not None]
        return np.zeros((0, 0)) if self.matrix is None else self.matrix[:, chosen]

    def stated(self) -> dict[str, object]:
        """Return the entry of the provenance; empty if nothing was logged."""
        if not self.columns and not self.left_out:
            return {}
        first = dict(list(self.left_out.items())[:_STATED_AS_LEFT_OUT])
        more = len(self.left_out) - len(first)
        further = {"…": f"{more} further columns"} if more else {}
        return {"covariates": [column.name for column in self.columns], "left_out": first | further}


NO_LOGGED_COLUMNS = LoggedColumns()


class _LeftOutError(Exception):
    """A column is no covariate, for the reason in its text."""


def logged_columns(
    runs: Sequence[Run], t_s: Floats, started_h: Floats, before_s: Floats | None = None
) -> LoggedColumns:
    """Return the logged columns of `runs` at times `t_s` (R, K + 1) on their clocks.

    `started_h` (R,) [h] are the starts since the session began. Columns of runs come before those of poses, in the
    order of their tables. `before_s` (R, J), for windows, are times before they begin: a prediction knows no later
    value.
    """
    used: list[LoggedColumn] = []
    left_out: dict[str, str] = {}
    started_s = np.array([run.started_s for run in runs])
    order = _rank(started_s)
    room = LOGGED.max_regressors
    for name, column in _columns(runs, t_s, before_s):
        shown = name if name.isprintable() else ascii(name)
        label = shown if len(shown) <= LONGEST_NAME else f"{shown[:LONGEST_NAME]}…"
        try:
            if isinstance(column, str):
                raise _LeftOutError(column)
            _require_covariate(column, started_s + t_s[:, 0], {other.name for other in used})
            if _size(column) > room:
                raise _LeftOutError(f"more than {LOGGED.max_regressors} regressors: delete columns that cannot matter")
        except _LeftOutError as reason:
            left_out[label] = str(reason)
            continue
        used.append(column)
        room -= _size(column)
    if used and room and not _is_time(order, started_h):
        used.append(LoggedColumn(RUN_ORDER, np.repeat(order[:, None], t_s.shape[1], axis=1)))
    return _standardised(used, left_out)


def _rank(values: Floats) -> Floats:
    return np.unique(values, return_inverse=True)[1].astype(np.float64)


def _size(column: LoggedColumn) -> int:
    return len(column.levels) if len(column.levels) > 2 else 1


def _columns(runs: Sequence[Run], t_s: Floats, before_s: Floats | None) -> Iterator[tuple[str, LoggedColumn | str]]:
    """Yield each column by name, or why it cannot be read."""
    names = dict.fromkeys(name for run in runs for name in run.extra)
    cells = {name: [run.extra.get(name) for run in runs] for name in names if not _is_written(name)}
    if len({run.firmware for run in runs}) > 1:
        cells[_FIRMWARE] = [run.firmware for run in runs]
    for name, values in cells.items():
        try:
            yield name, _of_runs(name, values, t_s.shape[1])
        except _LeftOutError as reason:
            yield name, str(reason)
    for name in dict.fromkeys(name for run in runs for name in run.logged):
        if name in cells:
            yield f"{name} (poses)", "runs have a column of this name"
        else:
            before = None if before_s is None else _series(runs, name, before_s, TimeSeries.held_at)
            yield name, LoggedColumn(name, _series(runs, name, t_s, _interpolated), before=before)


def _is_written(name: str) -> bool:
    """Return whether agvbench itself writes a column of this name: these are consequences of a run and no causes."""
    return name in _WRITTEN or name.startswith(_WRITTEN_PREFIX)


def _of_runs(name: str, cells: list[Any], samples: int) -> LoggedColumn:
    """Return a column of the runs table; a text whose cells are all numbers is a column of numbers."""
    cells = [None if isinstance(cell, str) and not cell.strip() else cell for cell in cells]
    known = [cell for cell in cells if cell is not None]
    if all(isinstance(cell, str | bool) for cell in known) and (values := _as_numbers(cells)) is None:
        return _of_texts(name, [None if cell is None else str(cell).strip() for cell in cells], samples)
    if not all(isinstance(cell, str) or _is_number(cell) for cell in known) or (values := _as_numbers(cells)) is None:
        raise _LeftOutError("neither numbers nor texts")
    return LoggedColumn(name, np.repeat(values[:, None], samples, axis=1))


def _is_number(cell: object) -> bool:
    from decimal import Decimal

    return isinstance(cell, numbers.Real | Decimal) and not isinstance(cell, bool)


def _as_numbers(cells: list[Any]) -> Floats | None:
    """Return numbers (R,), NaN where there is none or it is not finite; None if a cell is no number."""
    if any(isinstance(cell, bool) or (isinstance(cell, str) and len(cell) > LONGEST_NAME) for cell in cells):
        return None
    try:
        return _finite(np.array([np.nan if cell is None else float(cell) for cell in cells]))
    except (ValueError, OverflowError):
        return None


def _finite(values: Floats) -> Floats:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.abs(values) <= _LARGEST_NUMBER, values, np.nan))


def _of_texts(name: str, cells: list[str | None], samples: int) -> LoggedColumn:
    """Return a column of texts; a level that few runs have is a missing value."""
    count = Counter(cell for cell in cells if cell is not None)
    if len(count) > LOGGED.max_levels and sum(count.values()) < 2 * len(count):
        raise _LeftOutError("an identifier or a remark: most texts differ")
    levels = sorted(level for level, runs in count.items() if runs >= LOGGED.min_level_runs)
    if len(levels) > LOGGED.max_levels:
        raise _LeftOutError(f"{len(levels)} different texts, more than {LOGGED.max_levels}")
    number = {level: float(k) for k, level in enumerate(levels)}
    values = np.array([number.get(cell, np.nan) if cell is not None else np.nan for cell in cells])
    return LoggedColumn(name, np.repeat(values[:, None], samples, axis=1), tuple(levels) or ("",))


def _series(runs: Sequence[Run], name: str, t_s: Floats, evaluate: Callable[[TimeSeries, Floats], Floats]) -> Floats:
    """Return a series of each run at its times `t_s` (R, n); NaN in a run without a finite value."""
    out = np.full(t_s.shape, np.nan)
    for row, run, own in zip(out, runs, t_s, strict=True):
        if (series := run.logged.get(name)) is None:
            continue
        known = np.isfinite(series.t_s) & np.isfinite(_finite(series.value))
        order = np.argsort(series.t_s[known], kind="stable")
        if len(order):
            row[:] = evaluate(TimeSeries(series.t_s[known][order], series.value[known][order]), own)
    return out


def _interpolated(series: TimeSeries, t_s: Floats) -> Floats:
    return np.interp(t_s, series.t_s, series.value)


def _require_covariate(column: LoggedColumn, begins_s: Floats, taken: set[str]) -> None:
    """Raise `_LeftOutError` if a column cannot be a covariate; runs or windows begin at `begins_s` (R,)."""
    name, per_run = column.name, column.per_run
    known = np.isfinite(per_run)
    if not can_name_column(name):
        raise _LeftOutError(f"its name is empty, longer than {LONGEST_NAME} characters or not printable")
    if name in COMPUTED | taken:
        raise _LeftOutError("the diagnosis has a covariate of this name: rename it")
    if name.lower().endswith(_IDENTIFIERS[2:]) or name.lower() in _IDENTIFIERS[:2]:
        raise _LeftOutError("an identifier, by its name")
    if np.count_nonzero(known) < LOGGED.min_runs:
        raise _LeftOutError(f"a value in {np.count_nonzero(known)} runs, fewer than {LOGGED.min_runs}")
    if _is_constant(column.values[np.isfinite(column.values)]):
        raise _LeftOutError("constant")
    if not column.levels and _counts(per_run[known], begins_s[known]):
        raise _LeftOutError("counts the runs: campaign_time_h and run_order are covariates")


def _is_constant(values: Floats) -> bool:
    return bool(np.ptp(values) <= _CONSTANT * np.max(np.abs(values)))


def _counts(values: Floats, begins_s: Floats) -> bool:
    """Return whether numbers (R,) count the runs or are a clock: campaign time and run order stand for these."""
    pairs = np.unique(np.column_stack([begins_s, values]), axis=0)
    times_s, own = pairs.T
    if len(pairs) > len(np.unique(begins_s)) or not np.all(np.diff(own) > 0.0):
        return False
    is_linear = max(_correlation(times_s, own), _correlation(_rank(times_s), own)) > _SAME
    return is_linear or bool(np.all(values == np.round(values)))


def _is_time(order: Floats, started_h: Floats) -> bool:
    """Return whether the order of runs (R,) is about the same covariate as campaign time."""
    return _correlation(order, started_h) ** 2 > LOGGED.same_as_time


def _correlation(one: Floats, other: Floats) -> float:
    one, other = (np.asarray(v - v.mean()) / max(float(np.max(np.abs(v))), 1e-300) for v in (one, other))
    size = float(np.sqrt(np.sum(one**2) * np.sum(other**2)))
    return float(one @ other) / size if size > 0.0 else 1.0


def _standardised(columns: list[LoggedColumn], left_out: Mapping[str, str]) -> LoggedColumns:
    """Return the columns with their regressors, all of equal mean and deviation."""
    regressors: list[Regressor] = []
    matrix: list[Floats] = []
    for column in columns:
        per_run = column.per_run
        known = np.isfinite(per_run)
        for level, value in _regressors(column, per_run):
            if _is_constant(value[known]):
                continue  # it varies within the runs, or within windows, only
            mean = float(np.mean(value[known]))
            deviation = max(float(np.std(value[known])), 1e-300)
            z = np.where(known, (value - mean) / deviation, 0.0)
            limit = np.inf if column.levels else LOGGED.max_standardised
            regressors.append(Regressor(column.name, level, mean, deviation))
            matrix.append(np.clip(z, -limit, limit))
    return LoggedColumns(tuple(columns), left_out, tuple(regressors), np.column_stack(matrix) if matrix else None)


def _regressors(column: LoggedColumn, per_run: Floats) -> Iterator[tuple[str | None, Floats]]:
    """Yield each number per run: that of the column, or whether it has a level."""
    if not column.levels:
        yield None, per_run
    elif len(column.levels) == 2:
        yield column.levels[1], per_run
    else:
        for k, level in enumerate(column.levels):
            yield level, (per_run == k).astype(np.float64)
