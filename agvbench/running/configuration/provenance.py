"""Where a campaign comes from: program, versions, revision, machine, and the files that decide what is driven."""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd

from agvbench.campaign import CampaignWriter
from agvbench.campaign.manifest import Manifest, sha256
from agvbench.campaign.tables.parquet import read_parquet
from agvbench.errors import FileError
from agvbench.planning.trajectories.loading import trajectory_file
from agvbench.running.configuration.benchmark_files import find_benchmark
from agvbench.running.configuration.settings import BenchSettings

INPUTS_TABLE = "inputs"
SIMULATED_TIME = "simulated"
_TRAJECTORY = "trajectory "
Row = Mapping[str, Any]

_PACKAGES = ("agvbench", "eclipse-zenoh", "numba", "numpy", "pandas", "pyarrow", "pytest", "scipy")


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def git_revision(directory: Path) -> str:
    """Return the git revision of `directory`, with ``+changed`` for uncommitted changes; "" outside a checkout."""
    command = ["git", "-C", str(directory), "describe", "--always", "--dirty=+changed", "--abbrev=12"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)  # noqa: S603
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def provenance(directory: Path, *, simulated: bool) -> dict[str, str]:
    """Return what is worth knowing about this session, for the report and for readers in a year.

    ``time`` names the clock of the campaign's times.
    """
    facts = {
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "time": SIMULATED_TIME if simulated else "wall clock",
        "git_revision": git_revision(directory),
        "python": sys.version.split()[0],
        "machine": platform.platform(),
        "host": platform.node(),
    }
    return facts | {package: _installed(package) for package in _PACKAGES}


def input_files(settings: BenchSettings, trajectories: Iterable[str]) -> list[Row]:
    """Return the files that decide what a session drives: ``input`` (option or kind and name), ``file``, ``sha256``.

    Raises
    ------
    AgvbenchError
        If one of them does not exist or cannot be read.
    """
    options = ("vehicle", "calibration", "corrected", "remainders")
    files = {f"--{name}": str(getattr(settings, name)) for name in options}
    files["--plant"] = settings.plant.rpartition(":")[0]
    files |= {f"benchmark {name}": str(find_benchmark(name)).partition("::")[0] for name in settings.benchmarks}
    return [*_rows(files), *trajectory_inputs(trajectories)]


def trajectory_inputs(names: Iterable[str]) -> list[Row]:
    """Return the files of trajectories as `input_files` does.

    Raises
    ------
    AgvbenchError
        If one of them does not exist or cannot be read.
    """
    return _rows({f"{_TRAJECTORY}{name}": str(trajectory_file(name)) for name in names})


def recorded_trajectories(inputs: Iterable[Row]) -> set[str]:
    """Return the names of the trajectories among rows of the table ``inputs``."""
    return {str(row["input"]).removeprefix(_TRAJECTORY) for row in inputs if row["input"].startswith(_TRAJECTORY)}


def _rows(files: Mapping[str, str]) -> list[Row]:
    return [
        {"input": name, "file": file, "sha256": _hash(Path(file))}
        for name, file in files.items()
        if Path(file).is_file()  # the plants and vehicles that ship are part of the program, whose version is recorded
    ]


def _hash(file: Path) -> str:
    try:
        return sha256(file)
    except OSError as error:
        raise FileError("cannot be read", where=file, value=error.strerror) from None


def require_same_inputs(recorded: Iterable[Row], now: Iterable[Row]) -> None:
    """Refuse files whose content is not that which the session began with.

    Raises
    ------
    FileError
        If one differs.
    """
    before = {row["input"]: row["sha256"] for row in recorded}
    for row in now:
        if before.get(row["input"], row["sha256"]) != row["sha256"]:
            raise FileError(
                f"has changed since the session began ({row['input']})", where=row["file"],
                remedy="restore it from a copy, or start anew without --resume",
            )  # fmt: skip


class RecordedInputs:
    """The table ``inputs`` of the campaign that `writer` records."""

    def __init__(self, writer: CampaignWriter) -> None:
        self._writer = writer
        self._rows = recorded_rows(writer.path, INPUTS_TABLE)

    def add(self, rows: Iterable[Row]) -> None:
        """Append the rows of files that are not in the table.

        Raises
        ------
        FileError
            If a file that is in it has other content now.
        RecordingError
            If the disk refuses.
        """
        require_same_inputs(self._rows, rows := list(rows))
        if len(extended := with_new(self._rows, rows, "input")) > len(self._rows):
            self._writer.write_table(INPUTS_TABLE, pd.DataFrame(extended))
            self._rows = extended


def recorded_rows(directory: Path, table: str) -> list[Row]:
    """Return the rows of a further table of the campaign in `directory`; none where it has no such table.

    Raises
    ------
    CampaignError
        If the table is damaged.
    """
    path = directory / f"{table}.parquet"
    Manifest(directory).check(path)
    return read_parquet(path).to_pylist() if path.exists() else []


def with_new(recorded: Sequence[Row], now: Iterable[Row], key: str) -> list[Row]:
    """Return the rows `recorded` and, after them, those of `now` with another `key`."""
    known = {row[key] for row in recorded}
    return [*recorded, *(row for row in now if row[key] not in known)]
