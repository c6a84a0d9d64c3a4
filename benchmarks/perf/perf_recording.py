"""Recording: rows/s appended and read again, against pandas and CSV doing the same.

300 runs of 1200 poses and 300 commands, one part for each run and table on both sides, so that a killed process
loses no finished run; then the same rows gathered in one file for each table. Ours checks what it writes and what
it reads, the peer does not. Run with ``python benchmarks/perf/perf_recording.py``.
"""

from __future__ import annotations

import gc
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from rich.console import Console
from rich.table import Table

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter
from agvbench.types import Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

RUNS, POSES, COMMANDS, ROUNDS = 300, 1200, 300, 3
ROWS = RUNS * (1 + POSES + COMMANDS)
JOBS = (("append", "a part for each run", 3.0), ("read", "a part for each run", 1.5), ("read file", "one file", 1.0))
TABLES = ("poses", "commands", "runs")
HEADER = CampaignHeader(1, "perf", "thesis", 0.1, 0.1, Channels.alike("us"), 120.0)


def make_run(number: int) -> Run:
    """Return a run of a drifting vehicle with 0.3 mm of noise."""
    rng = np.random.default_rng(number)
    t_s, when = np.arange(POSES) / 120.0, np.arange(COMMANDS) / 30.0
    x_m, y_m = np.cumsum(rng.normal(2e-3, 1e-4, (2, POSES)), axis=1) + rng.normal(0.0, 3e-4, (2, POSES))
    heading_rad, error_m = rng.normal(0.0, 3e-3, POSES), rng.uniform(0.0, 1e-3, POSES)
    tracked, frame = np.ones(POSES, np.bool_), np.arange(POSES)
    frames = Frames(t_s, x_m, y_m, heading_rad, tracked, frame, error_m, t_s + 0.004)
    commands = Commands(when, *rng.integers(1100, 1900, (3, COMMANDS)).astype(np.float64))
    name = f"trajectory-1-calibrated-r{number:03d}"
    target, start_s = Pose(2.0, 0.0, 0.0), 12.0 * number
    return Run(name, "trajectory", "1", "calibrated", number, target, start_s, "ok", "1.0", commands, frames)


def as_frames(run: Run) -> dict[str, pd.DataFrame]:
    """Return the run as the rows that pandas writes."""
    row = {name: getattr(run, name) for name in ("run_id", "experiment", "trajectory", "condition", "repeat")}
    row |= {"started_s": run.started_s, "status": run.status, **run.target._asdict()}
    poses, commands = ({"run_id": run.run_id, **asdict(part)} for part in (run.frames, run.commands))
    return {"poses": pd.DataFrame(poses), "commands": pd.DataFrame(commands), "runs": pd.DataFrame([row])}


def append_ours(runs: Sequence[Run], directory: Path, *, durable: bool) -> None:
    writer = CampaignWriter.create(directory, HEADER, durable=durable)
    for run in runs:
        writer.append(run)


def append_csv(runs: Sequence[Run], directory: Path) -> None:
    for name in TABLES:
        (directory / name).mkdir(parents=True)
    for run in runs:
        for name, frame in as_frames(run).items():
            temporary = directory / name / "part.tmp"
            frame.to_csv(temporary, index=False)
            temporary.rename(directory / name / f"{run.run_id}.csv")


def read_ours(directory: Path) -> None:
    campaign = Campaign.open(directory)
    assert len(campaign.poses) + len(campaign.commands) + len(campaign.runs) == ROWS


def read_csv(directory: Path) -> None:
    tables = [pd.concat([pd.read_csv(part) for part in sorted((directory / name).iterdir())]) for name in TABLES]
    assert sum(map(len, tables)) == ROWS


def gather(parts: Path, text: Path) -> tuple[Path, Path]:
    """Gather the rows of both sides in one file for each table."""
    ours, peer = parts.with_name("ours"), parts.with_name("peer")
    ours.mkdir()
    (ours / "campaign.toml").write_bytes((parts / "campaign.toml").read_bytes())
    for name in TABLES:
        pq.write_table(pq.read_table(parts / f"{name}.parquet"), ours / f"{name}.parquet")
        (peer / name).mkdir(parents=True)
        whole = pd.concat([pd.read_csv(part) for part in sorted((text / name).iterdir())])
        whole.to_csv(peer / name / "all.csv", index=False)
    return ours, peer


def seconds(call: Callable[[], None]) -> float:
    gc.collect()
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def measure(runs: Sequence[Run], root: Path) -> dict[str, float]:
    """Return the seconds of every job, measured one after another on the same runs."""
    parts, durable, text = root / "parts", root / "durable", root / "text"
    times = {
        "append": seconds(lambda: append_ours(runs, parts, durable=False)),
        "append csv": seconds(lambda: append_csv(runs, text)),
        "append durable": seconds(lambda: append_ours(runs, durable, durable=True)),
        "read": seconds(lambda: read_ours(parts)),
        "read csv": seconds(lambda: read_csv(text)),
        "open": seconds(lambda: len(Campaign.open(parts)) and None),
        "bytes": sum(file.stat().st_size for file in parts.rglob("*.parquet") if file.is_file()) / ROWS,
        "bytes csv": sum(file.stat().st_size for file in text.rglob("*.csv")) / ROWS,
    }
    ours, peer = gather(parts, text)
    return times | {
        "read file": seconds(lambda: read_ours(ours)),
        "read file csv": seconds(lambda: read_csv(peer)),
    }


def main() -> int:
    """Print what | ours | peer | ratio | bound met?; return 0 if every bound is met."""
    runs = [make_run(number) for number in range(RUNS)]
    rounds = []
    for _ in range(ROUNDS + 1):  # the first round imports and compiles what the others use
        with tempfile.TemporaryDirectory() as directory:
            rounds.append(measure(runs, Path(directory)))
    middle = {name: statistics.median(r[name] for r in rounds[1:]) for name in rounds[0]}

    table = Table(title=f"recording, {RUNS} runs of {POSES} poses and {COMMANDS} commands, medians of {ROUNDS}")
    for heading in ("what", "ours", "pandas CSV", "ratio", "bound met?"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    met = []
    for job, layout, bound in JOBS:
        ratio = statistics.median(r[f"{job} csv"] / r[job] for r in rounds[1:])
        met.append(ratio >= bound)
        speeds = (f"{ROWS / middle[name] / 1e3:,.0f} k rows/s" for name in (job, f"{job} csv"))
        table.add_row(
            f"{job.split()[0]}, {layout}", *speeds, f"{ratio:.1f}×", f"≥ {bound:g}×: {'yes' if met[-1] else 'NO'}"
        )
    table.add_row("bytes per row", f"{middle['bytes']:.1f}", f"{middle['bytes csv']:.1f}", "", "")
    for what, name in (("append one run", "append"), ("append one run, forced to disk", "append durable")):
        table.add_row(
            what, f"{1e3 * middle[name] / RUNS:.1f} ms", f"{1e3 * middle['append csv'] / RUNS:.1f} ms", "", ""
        )
    table.add_row("open (head and runs)", f"{1e3 * middle['open']:.0f} ms", "", "", "")
    Console().print(table)
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
