"""One cell of a sweep: a bench session in a process of its own, reduced to medians on the machine that drove it."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec

from agvbench.errors import AgvbenchError
from agvbench.workflows.sweep.lab_files import LabFiles

_DONE = (0, 1)  # 1: some run was never driven well enough; the others count
_SAID = 300
MARK = "cells.jsonl"
"""The file by which a worker knows the directory of the sweep, where campaigns are kept."""


class CellRequest(msgspec.Struct, frozen=True):
    """What a worker needs: options of ``agvbench bench``, the files of the folder, and where to keep the campaign."""

    benchmarks: tuple[str, ...]
    flags: tuple[str, ...]
    lab: LabFiles | None = None
    keep: str = ""
    diagnose: bool = False


class Cost(msgspec.Struct, frozen=True):
    """What a cell took: time on the clock and of processors [s], most memory and size of its campaign [bytes]."""

    elapsed_s: float
    processor_s: float
    memory_bytes: int
    campaign_bytes: int


class Row(msgspec.Struct, frozen=True):
    """Repeats of one trajectory under one condition: their number, and the median magnitude of each metric."""

    trajectory: str
    condition: str
    n: int
    medians: dict[str, float]


class CellResult(msgspec.Struct, frozen=True):
    """What a cell found; ``sha256`` is that of its ``errors.parquet``, which holds every metric of every run."""

    is_complete: bool
    sha256: str
    rows: tuple[Row, ...]
    cost: Cost
    verdict: str = ""
    named: tuple[str, ...] = ()


class _Effect(msgspec.Struct):
    name: str


class _Diagnosis(msgspec.Struct):
    """What a sweep keeps of a diagnosis."""

    verdict: str
    effects: tuple[_Effect, ...] = ()


def drive_cell(request: CellRequest) -> CellResult:
    """Drive a cell, and diagnose it where that is asked for.

    Raises
    ------
    AgvbenchError
        If the bench or the diagnosis ends with an error, or this machine lacks the files of the sweep.
    """
    if request.lab is not None:
        request.lab.require_here()
    with tempfile.TemporaryDirectory(prefix="agvbench-sweep-") as temporary:
        campaign = Path(temporary) / "campaign"
        folder = Path(temporary) if request.lab is None else Path(request.lab.folder)
        bench = _Process(folder)
        command = ["bench", *request.benchmarks, *request.flags, "--no-report", f"--out={campaign}"]
        is_complete = bench.run(command, Path(temporary)) == 0
        verdict, named = _diagnosed(bench, campaign, Path(temporary)) if request.diagnose else ("", ())
        size = sum(path.stat().st_size for path in campaign.rglob("*") if path.is_file())
        sha256, rows = _measured(campaign)
        if request.keep:
            _keep(campaign, Path(request.keep))
    return CellResult(is_complete, sha256, rows, bench.cost(size), verdict, named)


class _Process:
    """Runs ``agvbench`` in `folder`, and adds up what that takes."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._began = folder, time.monotonic()
        self._processor_s, self._memory = 0.0, 0

    def run(self, arguments: Sequence[str], logs: Path) -> int:
        """Run a command; return its exit code, 0 or 1.

        Raises
        ------
        AgvbenchError
            If the command ends with another code.
        """
        with (logs / "log").open("w+b") as log:
            command = [sys.executable, "-m", "agvbench", *arguments]
            with _killed_on_error(
                subprocess.Popen(command, cwd=self._folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)  # noqa: S603
            ) as process:
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode = code = os.waitstatus_to_exitcode(status)
            self._processor_s += usage.ru_utime + usage.ru_stime
            self._memory = max(self._memory, usage.ru_maxrss * 1024)
            if code in _DONE:
                return code
            log.seek(0)
            said = " ".join(log.read().decode(errors="replace").split())[-_SAID:]
        raise AgvbenchError(f"agvbench {arguments[0]} ended with exit code {code}", value=said or "it said nothing")

    def cost(self, campaign_bytes: int) -> Cost:
        return Cost(time.monotonic() - self._began, self._processor_s, self._memory, campaign_bytes)


@contextmanager
def _killed_on_error(process: subprocess.Popen[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    try:
        yield process
    except BaseException:
        process.kill()
        process.wait()
        raise


def _measured(campaign: Path) -> tuple[str, tuple[Row, ...]]:
    """Return the hash of ``errors.parquet``, and the medians of the runs that count."""
    from agvbench.metrics.table import FILE, metric_table, read_metrics, write_metrics
    from agvbench.types import RUN_OK

    table = read_metrics(campaign)
    if table is None:
        table = metric_table(campaign)
        write_metrics(campaign, table)
    counted = table[table["status"] == RUN_OK]
    rows = []
    for (trajectory, condition), runs in counted.groupby(["trajectory", "condition"], sort=True):
        medians = {
            column_name(str(metric), str(unit)): float(values.abs().median())
            for (metric, unit), values in runs.groupby(["metric", "unit"], sort=True)["value"]
        }
        rows.append(Row(str(trajectory), str(condition), int(runs["run_id"].nunique()), medians))
    return hashlib.sha256((campaign / FILE).read_bytes()).hexdigest(), tuple(rows)


def column_name(metric: str, unit: str) -> str:
    """Return the name of a metric's column, with its unit.

    >>> column_name("position_error", "mm"), column_name("slip", "m/s"), column_name("score", "")
    ('position_error_mm', 'slip_m_per_s', 'score')
    """
    word = "".join(c if c.isalnum() else "_" for c in unit.replace("/", "_per_"))
    return f"{metric}_{word}" if word else metric


def _diagnosed(bench: _Process, campaign: Path, logs: Path) -> tuple[str, tuple[str, ...]]:
    """Return verdict and named effects."""
    answer = logs / "diagnosis.json"
    bench.run(["diagnose", str(campaign), f"--json={answer}"], logs)
    found = msgspec.json.decode(answer.read_bytes(), type=_Diagnosis)
    return found.verdict, tuple(effect.name for effect in found.effects)


def _keep(campaign: Path, target: Path) -> None:
    """Move a campaign into the directory of the sweep, which another machine must share."""
    if not (target.parent.parent / MARK).is_file():
        raise AgvbenchError(
            "worker does not share the directory of the sweep", where=target.parent.parent,
            remedy="give --out a folder that every machine has under this path, or leave out --keep",
        )  # fmt: skip
    target.parent.mkdir(exist_ok=True)
    shutil.rmtree(target, ignore_errors=True)  # of an attempt whose worker died
    shutil.move(campaign, target)
