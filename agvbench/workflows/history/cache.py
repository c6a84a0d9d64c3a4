"""What was read of campaigns before, in the user's cache: a further night reads its own campaign only.

A campaign counts as unchanged while size and modification time of the files that it was read from are. The content of
the cache is a table like those of campaigns; one that is damaged or of another version is as good as none.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from agvbench import __version__
from agvbench.campaign.atomic_files import write_atomically
from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.campaign.tables.parquet import read_parquet, to_parquet
from agvbench.compiled import cache_directory
from agvbench.errors import AgvbenchError
from agvbench.metrics.table import FILE
from agvbench.workflows.history.cells import KEYS, Codes, MetricCells, encoded, read_cells
from agvbench.workflows.history.folders import PROVENANCE, Dated, DatedBy, dated

_READ_FROM = (FILE_NAME, FILE, PROVENANCE)
_VERSION = f"{__version__}-1"
"""Of the program, and of how it reduces a campaign."""
_UNUSED_S = 90 * 86400.0
_OF_CAMPAIGN = ("campaign", "stamp", "driven", "dated_by", "vehicle", "firmware")
_NUMBERS = ("repeats", "median", "spread")


@dataclass(frozen=True)
class ReadCampaign:
    """A campaign that was read; ``name`` is its path below the folder, ``stamp`` that of the files it was read from."""

    path: Path
    name: str
    stamp: str
    driven: Dated
    vehicle: str
    cells: MetricCells


class CampaignCache:
    """The campaigns below a folder that were read before.

    Parameters
    ----------
    folder
        Where the campaigns are.
    directory
        Where the cache is; by default the user's, as for machine code.
    """

    def __init__(self, folder: Path, directory: Path | None = None) -> None:
        self._folder = folder
        key = hashlib.sha256(str(folder.resolve()).encode("utf-8", "surrogateescape")).hexdigest()
        self._file = (directory or cache_directory()) / "history" / f"{key}.parquet"
        self._kept: dict[str, ReadCampaign] = {}
        with suppress(AgvbenchError, pa.ArrowException, OSError, KeyError, ValueError, IndexError, TypeError):
            self._kept = {one.name: one for one in self._load()}

    def read(self, path: Path) -> ReadCampaign:
        """Return the campaign in a directory, as it was read before or now.

        Raises
        ------
        AgvbenchError
            If it cannot be read; the errors are those of `read_cells` and `CampaignHeader.load`.
        OSError
            If the disk refuses.
        """
        name, stamp = path.relative_to(self._folder).as_posix(), _stamp(path)
        kept = self._kept.get(name)
        if kept is None or kept.stamp != stamp:
            header = CampaignHeader.load(path / FILE_NAME)
            kept = ReadCampaign(path, name, stamp, dated(path), header.vehicle_name, read_cells(path))
        return kept

    def keep(self, campaigns: Iterable[ReadCampaign]) -> None:
        """Keep these campaigns, and no others; where the cache cannot be written, nothing is kept."""
        now = {one.name: one for one in campaigns if len(one.cells.repeats)}
        if not now or (now.keys() == self._kept.keys() and all(now[name] is self._kept[name] for name in now)):
            return
        with suppress(OSError, pa.ArrowException):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self._file, to_parquet(_table(list(now.values()))), durable=False)
            self._delete_unused()

    def _delete_unused(self) -> None:
        """Delete what was kept of folders whose history was not asked for in a long time."""
        for file in self._file.parent.glob("*.parquet"):
            if time.time() - file.stat().st_mtime > _UNUSED_S:
                file.unlink(missing_ok=True)

    def _load(self) -> Iterator[ReadCampaign]:
        table = read_parquet(self._file, plain=False)
        texts = {name: encoded(table[name]) for name in (*_OF_CAMPAIGN, *KEYS)}
        names = tuple(texts[name][0] for name in KEYS)
        codes = np.vstack([texts[name][1] for name in KEYS])
        numbers = {name: table[name].to_numpy() for name in _NUMBERS}
        starts = np.flatnonzero(np.diff(texts["campaign"][1], prepend=-1))
        for first, last in zip(starts, [*starts[1:], len(table)], strict=True):
            of = {name: texts[name][0][texts[name][1][first]] for name in _OF_CAMPAIGN}
            part = {name: values[first:last] for name, values in numbers.items()}
            yield _restored(self._folder, of, MetricCells(names, codes[:, first:last], **part, firmware=of["firmware"]))


def _stamp(campaign: Path) -> str:
    """Return the version, and size and modification time of the files that a campaign is read from."""
    stamps = [_VERSION]
    for name in _READ_FROM:
        try:
            status = (campaign / name).stat()
            stamps.append(f"{status.st_size}:{status.st_mtime_ns}")
        except FileNotFoundError:
            stamps.append("-")
    return " ".join(stamps)


def _restored(folder: Path, of: Mapping[str, str], cells: MetricCells) -> ReadCampaign:
    driven = Dated(datetime.fromisoformat(of["driven"]), DatedBy(of["dated_by"]))
    return ReadCampaign(folder / of["campaign"], of["campaign"], of["stamp"], driven, of["vehicle"], cells)


def _table(campaigns: Collection[ReadCampaign]) -> pa.Table:
    """Return one row for each cell of each campaign; cells of a campaign are neighbours."""
    none: list[Codes] = [np.zeros(len(one.cells.repeats), np.int64) for one in campaigns]
    facts = zip(*map(_facts, campaigns), strict=True)
    columns: dict[str, Any] = {
        name: _texts([(text,) for text in of], none) for name, of in zip(_OF_CAMPAIGN, facts, strict=True)
    }
    for at, name in enumerate(KEYS):
        columns[name] = _texts([one.cells.names[at] for one in campaigns], [one.cells.codes[at] for one in campaigns])
    for name in _NUMBERS:
        columns[name] = np.concatenate([getattr(one.cells, name) for one in campaigns])
    return pa.table(columns)


def _facts(one: ReadCampaign) -> tuple[str, ...]:
    return (one.name, one.stamp, one.driven.at.isoformat(), str(one.driven.by), one.vehicle, one.cells.firmware)


def _texts(texts: Iterable[Sequence[str]], codes: Iterable[Codes]) -> pa.DictionaryArray:
    """Return a column of texts, of which each campaign has its own and their numbers."""
    numbers: dict[str, int] = {}
    parts = [
        np.array([numbers.setdefault(text, len(numbers)) for text in of], dtype=np.int32)[at]
        for of, at in zip(texts, codes, strict=True)
    ]
    return pa.DictionaryArray.from_arrays(np.concatenate(parts), list(numbers))
