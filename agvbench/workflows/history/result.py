"""The history of campaigns: nightly values, series with their levels, steps, and what changed there."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.notebook_html import heading_html, table_html
from agvbench.statistics.steps.change_points import FEWEST
from agvbench.workflows.output_files import write_file

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1
NIGHTS_FILE = "nights.parquet"
_SHOWN = 20


@dataclass(frozen=True)
class History:
    """Every campaign below a folder, by when it was driven, its nightly values, and the steps in them.

    Attributes
    ----------
    folder
        Where the campaigns lie.
    campaigns
        One row per campaign that was read: ``night`` (its number), ``campaign`` (path below the folder), ``driven``
        (UTC), ``dated_by`` (provenance, name or file), ``vehicle``, ``firmware``.
    nights
        One row per night, condition, metric and trajectory ("" for all): ``campaign``, ``driven``, ``unit``,
        ``repeats`` (runs that count), ``value``, ``repeatability`` (standard deviation of repeats) and ``stderr``
        (standard error of the value that the repeatability causes) in the unit.
    series
        One row per condition and metric: ``title``, ``unit``, ``nights``, ``latest`` (value), ``level`` (mean since
        the last step), ``sd`` (of nights about their levels, NaN where there are too few to find steps),
        ``repeatability`` (median over nights), ``steps``, ``digits``, ``margin``.
    changes
        One row per step, the latest first: ``condition``, ``metric``, ``unit``, ``campaign`` and ``driven`` of the
        first night after it, ``earliest`` and ``latest`` (campaigns; 95 % interval of that night) with
        ``earliest_driven`` and ``latest_driven``, the number of each as ``night``, ``earliest_night`` and
        ``latest_night``, the levels ``before`` and ``after``, ``change`` and ``sd`` in the unit, and ``facts``: pairs
        of a campaign in the interval and what it changed against the campaign before.
    unread
        One line per campaign that could not be read.
    alpha
        The chance of any false step, over all series.
    autocorrelation
        Of successive nights, over all series.
    """

    folder: Path
    campaigns: pd.DataFrame
    nights: pd.DataFrame
    series: pd.DataFrame
    changes: pd.DataFrame
    unread: tuple[str, ...]
    alpha: float
    autocorrelation: float

    @property
    def headline(self) -> str:
        """What was found, in one sentence."""
        tested, nights = int(self.series["sd"].notna().sum()), len(self.campaigns)
        if not tested:
            most = int(self.series["nights"].max())
            return f"No series has enough nights to find a step: at most {most} nights, at least {FEWEST} are needed."
        found = len(self.changes)
        return f"{found or 'No'} step{'s' * (found != 1)} in {tested} series of {nights} nights."

    def to_json(self) -> dict[str, Any]:
        """Return the history without the nightly values as what JSON holds (schema 1); not finite numbers are None."""
        return {
            "schema": SCHEMA,
            "folder": str(self.folder),
            "headline": self.headline,
            "alpha": self.alpha,
            "autocorrelation": self.autocorrelation,
            "unread": list(self.unread),
            "campaigns": _records(self.campaigns),
            "series": _records(self.series),
            "changes": _records(self.changes),
        }

    def _repr_html_(self) -> str:
        shown = self.changes.head(_SHOWN)
        rows = [
            [str(row["driven"])[:10], row["condition"], row["metric"], row["unit"], row["before"], row["after"],
             "; ".join(dict.fromkeys(fact for _, fact in row["facts"]))]
            for row in shown.to_dict("records")
        ]  # fmt: skip
        head = ("first night after", "condition", "metric", "unit", "before", "after", "changed there")
        more = f"{len(self.changes) - _SHOWN} earlier steps are in changes" if len(self.changes) > _SHOWN else ""
        return heading_html(f"History of {self.folder}", self.headline, more) + table_html("steps", head, rows)


def write_json(history: History, path: str | Path) -> None:
    """Write `history` as JSON (schema 1).

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = json.dumps(history.to_json(), indent=2, ensure_ascii=False, allow_nan=False)
    write_file("--json", Path(path), lambda file: file.write_text(f"{text}\n", encoding="utf-8"))


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(name): _plain(value) for name, value in row.items()} for row in frame.to_dict("records")]


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "isoformat"):
        return value.isoformat(timespec="seconds")
    if isinstance(value, tuple):
        return [{"campaign": campaign, "changed": fact} for campaign, fact in value]
    return value
