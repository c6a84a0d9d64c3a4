"""One campaign's metrics, reduced to medians and spreads of repeats."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from agvbench.compiled import cached_njit
from agvbench.errors import CampaignError, RecordingError
from agvbench.metrics.table import FILE, metric_table, read_columns, remedy_for, write_metrics
from agvbench.signals import MAD_TO_STD
from agvbench.statistics.intervals import FEWEST
from agvbench.types import RUN_OK, Floats

KEYS = ("condition", "metric", "unit", "trajectory")
_TEXTS = (*KEYS, "firmware", "status")
_COLUMNS = (*_TEXTS, "value")
Codes = NDArray[np.int64]


@dataclass(frozen=True)
class MetricCells:
    """Repeats of each condition, metric, unit and trajectory of one campaign, over the runs that count.

    ``names`` are the texts of each of `KEYS`; ``codes`` number them in each cell, shape (4, n). ``repeats``, ``median``
    and ``spread`` have shape (n,): medians are of absolute values, and a spread is the standard deviation of these from
    the median of their absolute deviations, NaN below three repeats.
    """

    names: tuple[tuple[str, ...], ...]
    codes: Codes
    repeats: Codes
    median: Floats
    spread: Floats
    firmware: str


def read_cells(campaign: Path) -> MetricCells:
    """Return the cells of the campaign in a directory; its hash is checked where the campaign lists one.

    A campaign without ``errors.parquet`` is evaluated, and keeps the file where its directory can be written.

    Raises
    ------
    CampaignError
        If a table cannot be read or has other columns.
    FileError
        If a metric of the lab cannot be evaluated.
    """
    path = campaign / FILE
    if not path.exists():
        frame = metric_table(campaign)
        with suppress(RecordingError):
            write_metrics(campaign, frame)
        return _reduced(pa.Table.from_pandas(frame, preserve_index=False), path)
    return _reduced(read_columns(campaign, _COLUMNS, plain=False), path)


def _reduced(table: pa.Table, path: Path) -> MetricCells:
    try:
        texts = {name: encoded(table[name]) for name in _TEXTS}
        values = table["value"].cast(pa.float64()).to_numpy()
    except (pa.ArrowException, TypeError, ValueError):
        raise CampaignError("has a column of another type", where=path, remedy=remedy_for(path)) from None
    status, is_ok = texts["status"], np.zeros(1 + len(texts["status"][0]), dtype=np.bool_)
    is_ok[: len(status[0])] = [text == RUN_OK for text in status[0]]
    counts = is_ok[status[1]] & np.isfinite(values)
    versions, version = texts["firmware"]
    firmware = sorted({versions[code] for code in np.flatnonzero(np.bincount(version[counts]))})
    codes = np.vstack([texts[name][1][counts] for name in KEYS])
    return _cells([texts[name][0] for name in KEYS], codes, values[counts], ", ".join(filter(None, firmware)))


def encoded(column: pa.ChunkedArray) -> tuple[tuple[str, ...], Codes]:
    """Return the distinct texts of a column and the number of each row's; an empty cell has the text ""."""
    whole = column.combine_chunks()
    if not isinstance(whole.type, pa.DictionaryType):
        whole = whole.cast(pa.string()).dictionary_encode()
    texts = tuple("" if text is None else str(text) for text in whole.dictionary.to_pylist())
    if whole.null_count:
        return (*texts, ""), whole.indices.fill_null(len(texts)).to_numpy().astype(np.int64)
    return texts, whole.indices.to_numpy().astype(np.int64)


def _cells(names: Sequence[tuple[str, ...]], codes: Codes, values: Floats, firmware: str) -> MetricCells:
    shape = tuple(max(1, len(texts)) for texts in names)
    cell, kinds = pd.factorize(np.ravel_multi_index(tuple(codes), shape))  # does not sort, as np.unique does
    parts = np.array(np.unravel_index(kinds, shape), dtype=np.int64)
    return MetricCells(tuple(names), parts, *_statistics(cell.astype(np.int64), np.abs(values), len(kinds)), firmware)


def _statistics(cell: Codes, values: Floats, count: int) -> tuple[Codes, Floats, Floats]:
    repeats, median, deviation = _medians(cell, values, count)
    return repeats, median, np.where(repeats >= FEWEST, MAD_TO_STD * deviation, np.nan)


@cached_njit()
def _medians(cell: Codes, values: Floats, count: int) -> tuple[Codes, Floats, Floats]:  # pragma: no cover - compiled
    """Return the number, the median, and the median absolute deviation of the values (n,) of each cell."""
    repeats = np.zeros(count, dtype=np.int64)
    for one in cell:
        repeats[one] += 1
    end = np.cumsum(repeats)
    place, grouped = end - repeats, np.empty(len(values))
    for k in range(len(values)):
        grouped[place[cell[k]]] = values[k]
        place[cell[k]] += 1
    median, deviation = np.empty(count), np.empty(count)
    for one in range(count):
        own = grouped[end[one] - repeats[one] : end[one]]
        median[one] = np.median(own)
        deviation[one] = np.median(np.abs(own - median[one]))
    return repeats, median, deviation
