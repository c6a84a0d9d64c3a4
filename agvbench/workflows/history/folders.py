"""The campaigns below a folder, and when each was driven."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from agvbench.campaign.header import FILE_NAME
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.errors import AgvbenchError, CampaignError

PROVENANCE = "provenance.parquet"
_DATE_IN_NAME = re.compile(r"(?<!\d)(\d{4})-?(\d{2})-?(\d{2})(?:[T_-](\d{2})[:.-]?(\d{2})(?:[:.-]?(\d{2}))?)?(?!\d)")


class DatedBy(StrEnum):
    """What a campaign's date was taken from."""

    PROVENANCE = "provenance"
    NAME = "name"
    FILE = "file"


@dataclass(frozen=True)
class Dated:
    """When a campaign was driven (UTC), and what says so."""

    at: datetime
    by: DatedBy


def campaigns_below(folder: Path, refused: Callable[[str], None]) -> Iterator[Path]:
    """Yield every directory with ``campaign.toml`` below `folder`, or `folder` itself, by name.

    Symbolic links are not followed, and nothing is looked for inside a campaign. A directory that cannot be listed is
    `refused` with one line.
    """

    def say(error: OSError) -> None:
        refused(str(CampaignError("cannot be listed", where=error.filename, value=error.strerror)))

    for directory, below, files in os.walk(folder, onerror=say):
        if FILE_NAME in files:
            below.clear()
            yield Path(directory)
        below.sort()


def dated(campaign: Path) -> Dated:
    """Return when the campaign in a directory was driven.

    This is when its session began, if its table ``provenance`` says so; else the date in the directory's name, as UTC;
    else the modification time of ``campaign.toml``.

    Raises
    ------
    OSError
        If there is no ``campaign.toml``.
    """
    if (began := _began(campaign / PROVENANCE)) is not None:
        return Dated(began, DatedBy.PROVENANCE)
    if (named := _date_in_name(campaign.name)) is not None:
        return Dated(named, DatedBy.NAME)
    return Dated(datetime.fromtimestamp((campaign / FILE_NAME).stat().st_mtime, UTC), DatedBy.FILE)


def _began(table: Path) -> datetime | None:
    """Return the time under ``began`` in a table ``provenance``; None where there is none that can be read."""
    try:
        rows = read_parquet(table, columns=("name", "value")).to_pydict()
        facts = dict(zip(map(str, rows["name"]), map(str, rows["value"]), strict=True))
        return _in_utc(datetime.fromisoformat(facts["began"]))
    except (AgvbenchError, OSError, KeyError, ValueError, OverflowError):
        return None


def _date_in_name(name: str) -> datetime | None:
    """Return the first date in a name, with the time of day after it.

    >>> _date_in_name("night-2026-11-23_21-05"), _date_in_name("mule-20261123")
    (datetime.datetime(2026, 11, 23, 21, 5, tzinfo=datetime.timezone.utc), \
datetime.datetime(2026, 11, 23, 0, 0, tzinfo=datetime.timezone.utc))
    """
    for match in _DATE_IN_NAME.finditer(name):
        try:
            year, month, day, hour, minute, second = (int(part or 0) for part in match.groups())
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:  # digits that are no date
            continue
    return None


def _in_utc(when: datetime) -> datetime:
    return when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
