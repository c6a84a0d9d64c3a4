"""Runs and faults of a campaign that is still being recorded, each once."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.header import FILE_NAME
from agvbench.campaign.manifest import PLANNED_TABLE
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.running.configuration.provenance import Row
from agvbench.running.configuration.settings import SETTINGS_FILE
from agvbench.running.execution.event_log import EVENTS_TABLE

_TABLES = ("runs", "commands", "poses")
_BESIDE = (FILE_NAME, SETTINGS_FILE, "vehicle.toml", "inputs.parquet")


class CampaignFollower:
    """Reads what is new in the campaign in `directory`.

    New parts are opened as a campaign of their own, in a directory of links: opening the whole campaign again for each
    run would take a time that grows with it.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._read: set[str] = set()
        self._events = 0
        self._plans: tuple[bool, PlannedPaths] | None = None

    def new_runs(self) -> list[MeasuredRun]:
        """Return the runs that were recorded since the last call, with their planned paths."""
        names = self._new_parts()
        if not names:
            return []
        with tempfile.TemporaryDirectory(prefix="agvbench-live-") as folder:
            campaign = Campaign.open(self._linked(Path(folder), names))
            runs = list(map(self._planned_paths(campaign).measured, campaign))
        self._read.update(names)
        return runs

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

    def new_events(self) -> list[Row]:
        """Return the rows of the table of events that were recorded since the last call."""
        rows = _rows(self._directory / f"{EVENTS_TABLE}.parquet")
        new, self._events = rows[self._events :], len(rows)
        return new

    def planned_runs(self) -> list[tuple[str, str, str]]:
        """Return trajectory or experiment, condition and name of every run that the session is to drive."""
        rows = _rows(self._directory / f"{PLANNED_TABLE}.parquet")
        return [
            (row["trajectory"] or row["experiment"], row["condition"] or "uncalibrated", row["run_id"]) for row in rows
        ]


def _rows(path: Path) -> list[Row]:
    # Not checked against the list of hashes, which is parsed anew each time and grows with every run.
    return read_parquet(path).to_pylist() if path.exists() else []


def _names(folder: Path) -> set[str]:
    try:
        return {name for name in os.listdir(folder) if name.endswith(".parquet")}  # noqa: PTH208  (a tenth of the time)
    except FileNotFoundError:
        return set()
