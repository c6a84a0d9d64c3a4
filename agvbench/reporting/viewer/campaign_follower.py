"""Runs and faults of a campaign that is still being recorded, each once."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from agvbench.campaign import Campaign
from agvbench.campaign.header import FILE_NAME
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.types import Run

_TABLES = ("runs", "commands", "poses")
_BESIDE = (FILE_NAME, "vehicle.toml", "inputs.parquet")
_EVENTS, _PLANNED = "events.parquet", "planned.parquet"


class CampaignFollower:
    """Reads what is new in the campaign in `directory`.

    New parts are opened as a campaign of their own, in a directory of links: opening the whole campaign again for each
    run would take a time that grows with it.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._read: set[str] = set()
        self._faults = 0
        self._plans: tuple[bool, PlannedPaths] | None = None

    def new_runs(self) -> list[tuple[Run, PlannedPaths]]:
        """Return the runs that were recorded since the last call, with the planned paths of their campaign."""
        names = self._new_parts()
        if not names:
            return []
        with tempfile.TemporaryDirectory(prefix="agvbench-live-") as folder:
            campaign = Campaign.open(self._linked(Path(folder), names))
            runs = list(campaign)
            plans = self._planned_paths(campaign)
        self._read.update(names)
        return [(run, plans) for run in runs]

    def plans(self) -> PlannedPaths | None:
        """Return the planned paths, once a run was read."""
        return None if self._plans is None else self._plans[1]

    def _new_parts(self) -> list[str]:
        """Return the names of parts that are there in every table: a run is recorded with its last one."""
        recorded = [_names(self._directory / f"{table}.parquet") for table in _TABLES]
        return sorted(set.intersection(*recorded) - self._read)

    def _linked(self, folder: Path, names: list[str]) -> Path:
        for name in _BESIDE:
            if (self._directory / name).exists():
                (folder / name).symlink_to(self._directory / name)
        for table in _TABLES:
            (folder / f"{table}.parquet").mkdir()
            for name in names:
                (folder / f"{table}.parquet" / name).symlink_to(self._directory / f"{table}.parquet" / name)
        return folder

    def _planned_paths(self, campaign: Campaign) -> PlannedPaths:
        """Return planned paths, made once, and again when the session has calibrated."""
        is_calibrated = (campaign.path / "vehicle.toml").exists()
        if self._plans is None or self._plans[0] != is_calibrated:
            self._plans = is_calibrated, PlannedPaths(campaign)
        return self._plans[1]

    def new_faults(self) -> Iterator[tuple[float, str, str]]:
        """Yield time [s] of the campaign, level and line of the events that were recorded since the last call."""
        if not (self._directory / _EVENTS).exists():
            return
        rows = pd.read_parquet(os.fspath(self._directory / _EVENTS)).to_dict("records")
        for row in rows[self._faults :]:
            line = f"{row['run_id']} {row['source']} {row['event']}: {row['text']}"
            yield float(row["time_s"]), str(row["level"]).upper(), line
        self._faults = len(rows)

    def planned_runs(self) -> list[tuple[str, str, str]]:
        """Return trajectory or experiment, condition and name of every run that the session is to drive."""
        if not (self._directory / _PLANNED).exists():
            return []
        rows = pd.read_parquet(os.fspath(self._directory / _PLANNED)).to_dict("records")
        return [
            (row["trajectory"] or row["experiment"], row["condition"] or "uncalibrated", row["run_id"]) for row in rows
        ]


def _names(folder: Path) -> set[str]:
    try:
        return {name for name in os.listdir(folder) if name.endswith(".parquet")}  # noqa: PTH208  (a tenth of the time)
    except FileNotFoundError:
        return set()
