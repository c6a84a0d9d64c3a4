"""Open a campaign directory, read its runs, and know where its sessions begin."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.campaign.manifest import Manifest
from agvbench.campaign.names import as_texts
from agvbench.campaign.tables.command_columns import by_role, command_columns
from agvbench.campaign.tables.consistency import check_commands, check_poses, check_runs
from agvbench.campaign.tables.motion_checks import check_motion
from agvbench.campaign.tables.parts import part_name
from agvbench.campaign.tables.schema import NAMES_OF_POSES, POSES, RUNS, TABLES, numbers
from agvbench.campaign.tables.source import SUFFIXES, Source
from agvbench.campaign.tables.timed_table import TimedTable, blank_untracked
from agvbench.errors import CampaignError
from agvbench.notebook_html import heading_html, table_html
from agvbench.types import CONDITIONS, RUN_OK, Commands, Floats, Frames, Pose, Run, TimeSeries

if TYPE_CHECKING:
    import pandas as pd

_KNOWN = frozenset(column.name for column in RUNS)
_FRAME_COLUMNS = tuple(field.name for field in fields(Frames))


class Campaign:
    """A directory of runs, checked when opened; commands and poses are read and checked on first use.

    Runs are ordered by when they started. Get one with `Campaign.open`.
    """

    def __init__(
        self, path: Path, header: CampaignHeader, runs: pa.Table, sources: dict[str, Source], manifest: Manifest
    ) -> None:
        self.path = path
        self._manifest = manifest
        self.header = header
        self._runs = runs
        self._sources = sources
        self.run_ids: list[str] = runs["run_id"].to_pylist()
        self._early_s = np.zeros(len(self.run_ids))

    @classmethod
    def open(cls, path: str | Path) -> Campaign:
        """Open the campaign in directory `path`.

        Raises
        ------
        CampaignError
            If a file is absent, damaged or has changed since it was recorded, or the head or the runs table contradict
            the schema.
        """
        path = Path(path)
        if not path.is_dir():
            what = "is not a directory" if path.exists() else "does not exist"
            raise CampaignError(what, where=path, remedy="give a campaign directory")
        manifest = Manifest(path)
        manifest.check_beside()
        header = CampaignHeader.load(path / FILE_NAME)
        sources = {name: Source.find(path, name, manifest) for name in TABLES}
        manifest.require_files()
        runs = sources["runs"].read(RUNS)
        check_runs(runs, sources["runs"].path)
        if not runs.num_rows:
            raise CampaignError(
                "has no finished runs", where=sources["runs"].path, remedy="resume the campaign, or drive it again"
            )
        order = np.argsort(runs["started_s"].to_numpy(), kind="stable")
        return cls(path, header, runs.take(pa.array(order)), sources, manifest)

    def check(self) -> Campaign:
        """Read and check every table now; return self.

        Raises
        ------
        CampaignError
            If a table is damaged, contradicts another or the schema.
        """
        _ = self._poses  # reads and checks the commands, too
        return self

    @cached_property
    def _commands(self) -> TimedTable:
        source = self._sources["commands"]
        rows = by_role(source.read(command_columns(self.header)), self.header)
        table = TimedTable(source.path, rows, self.run_ids, in_parts=source.in_parts)
        check_commands(table, self._runs["status"].to_pylist(), self.header)
        # Some write a first command at −0.5 s, or at the first frame's time: a run's clock is 0 at its first command.
        self._early_s = table.first("t_s")
        table.shift(self._early_s)
        return table

    @cached_property
    def _poses(self) -> TimedTable:
        source = self._sources["poses"]
        rows = blank_untracked(source.read(POSES))
        table = TimedTable(source.path, rows, self.run_ids, in_parts=source.in_parts)
        last_s = self._commands.last("t_s")
        table.shift(self._early_s)
        check_poses(table, self._runs["status"].to_pylist(), last_s)
        check_motion(self.header, self._runs, self._commands, table)
        return table

    @cached_property
    def _logged(self) -> dict[str, Floats]:
        """The further columns of the poses table that are numbers (rows,), by name; NaN where a cell is empty."""
        table = self._poses.table
        further = {name: numbers(table[name]) for name in table.column_names if name not in NAMES_OF_POSES}
        return {name: values for name, values in further.items() if values is not None}

    @cached_property
    def runs(self) -> pd.DataFrame:
        """The runs table, by time of start; columns that schema 1 does not know are kept."""
        frame: pd.DataFrame = self._runs.to_pandas()
        return frame

    @cached_property
    def commands(self) -> pd.DataFrame:
        """The commands table by role (drive, front, rear), in the order of `run_ids`."""
        frame: pd.DataFrame = self._commands.table.to_pandas()
        return frame

    @cached_property
    def poses(self) -> pd.DataFrame:
        """The poses table, in the order of `run_ids` and then of arrival; NaN where not tracked."""
        frame: pd.DataFrame = self._poses.table.to_pandas()
        return frame

    def has_table(self, name: str) -> bool:
        """Return whether there is a further table of this name."""
        return any((self.path / f"{name}{suffix}").exists() for suffix in SUFFIXES)

    def recording(self, run_id: str) -> Path:
        """Return the file with the poses of a run: its part, or the table of all runs."""
        source = self._sources["poses"]
        return source.path / part_name(run_id) if source.in_parts else source.path

    def table(self, name: str) -> pd.DataFrame:
        """Return a further table (``"events"``, ``"provenance"``, …).

        Raises
        ------
        CampaignError
            If there is none of that name.
        """
        frame: pd.DataFrame = Source.find(self.path, name, self._manifest).read(()).to_pandas()
        return frame

    @cached_property
    def _rows(self) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = self._runs.to_pylist()
        return rows

    @cached_property
    def _index(self) -> dict[str, int]:
        return {run_id: index for index, run_id in enumerate(self.run_ids)}

    def __repr__(self) -> str:
        return f"<Campaign {self.header.name!r} in {str(self.path)!r}: {self._summary()}>"

    def _summary(self) -> str:
        counts = sum(status == RUN_OK for status in self._runs["status"].to_pylist())
        return f"vehicle {self.header.vehicle_name}, {len(self)} runs, {counts} of them count"

    def _repr_html_(self) -> str:
        conditions = _in_order(self.runs["condition"])
        columns = ["experiment", "trajectory", *conditions]
        table = table_html("runs that count", columns, _rows(self.runs, conditions))
        return heading_html(self.header.name, self._summary()) + table

    def run(self, run_id: str) -> Run:
        """Return one run.

        Raises
        ------
        CampaignError
            If there is no such run.
        """
        if run_id not in self._index:
            raise CampaignError(
                "has no such run", where=self.path, value=run_id, remedy="see the ids in its runs table"
            )
        return self._run(self._index[run_id])

    def __iter__(self) -> Iterator[Run]:
        return map(self._run, range(len(self.run_ids)))

    def __len__(self) -> int:
        return len(self.run_ids)

    def select(
        self,
        *,
        experiment: str | Collection[str] | None = None,
        condition: str | Collection[str] | None = None,
        trajectory: str | Collection[str] | None = None,
        session: str | Collection[str] | None = None,
        split: str | Collection[str] | None = None,
        ok_only: bool = True,
    ) -> list[Run]:
        """Return the runs that have one of the given values in every given column; by default only those that count.

        Raises
        ------
        InputError
            If a value is not text: trajectories are named ``"5"``, not 5.
        """
        wanted = {"experiment": experiment, "condition": condition, "trajectory": trajectory}
        wanted |= {"session": session, "split": split, "status": "ok" if ok_only else None}
        tests = {name: as_texts(value, where=name) for name, value in wanted.items() if value is not None}
        return [
            self._run(index)
            for index, row in enumerate(self._rows)
            if all(row.get(name) in values for name, values in tests.items())
        ]

    def _run(self, index: int) -> Run:
        row, commands, poses = self._rows[index], self._commands, self._poses
        when, seen = commands.rows(index), poses.rows(index)
        t_s = poses.column("t_s")[seen]
        return Run(
            **{name: row[name] for name in ("run_id", "experiment", "trajectory", "condition", "repeat")},
            **{name: row[name] for name in ("started_s", "status", "firmware")},
            target=Pose(row["target_x_m"], row["target_y_m"], row["target_heading_rad"]),
            commands=Commands(**{name: commands.column(name)[when] for name in ("t_s", "drive", "front", "rear")}),
            frames=Frames(**{name: poses.column(name)[seen] for name in _FRAME_COLUMNS}),
            session=row.get("session") or None,
            split=row.get("split") or None,
            extra={name: value for name, value in row.items() if name not in _KNOWN and value is not None},
            logged={name: TimeSeries(t_s, values[seen]) for name, values in self._logged.items()},
        )


def session_starts(runs: Iterable[Run]) -> dict[str | None, float]:
    """Return when each session's first run started [s since the campaign began], by name.

    >>> session_starts([])
    {}
    """
    began: dict[str | None, float] = {}
    for run in runs:
        began[run.session] = min(run.started_s, began.get(run.session, math.inf))
    return began


def _rows(runs: pd.DataFrame, conditions: list[str]) -> list[list[str | float | None]]:
    rows: list[list[str | float | None]] = []
    for (experiment, trajectory), group in runs.groupby(["experiment", "trajectory"]):
        own = group["condition"][group["status"] == RUN_OK]
        rows.append([str(experiment), str(trajectory), *(int((own == condition).sum()) for condition in conditions)])
    return rows


def _in_order(conditions: pd.Series) -> list[str]:
    found = [str(condition) for condition in conditions.unique()]
    return [c for c in CONDITIONS if c in found] + sorted(c for c in found if c not in CONDITIONS)
