"""Comparing and reporting against peers doing the same.

Rank test: ours against scipy's permutation test (ties) and its exact test (no ties). Bootstrap: against
``scipy.stats.bootstrap``. Recording: columns against logging row by row.
And ``agvbench report`` of 500 runs, a whole process, in seconds.
Run with ``python benchmarks/perf/perf_compare.py``.
"""

from __future__ import annotations

import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr
from rich.console import Console
from rich.table import Table
from scipy import stats

from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.statistics.hypothesis_tests import rank_test
from agvbench.statistics.intervals import median_difference_interval
from agvbench.types import Commands, Floats, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

ROUNDS, RUNS, POSES, REPORT_ROUNDS, REPORT_BOUND_S = 7, 500, 1200, 3, 10.0
TARGETS = {"1": (2.0, 0.0, 0.0), "2": (-2.0, 0.0, 0.0), "5": (1.0, 1.0, math.pi / 2), "6": (1.0, -1.0, -math.pi / 2)}


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def interleaved(ours: Callable[[], object], peer: Callable[[], object]) -> tuple[float, float, float]:
    """Return the medians [s] of both, run by turns, and the median of the ratios peer / ours."""
    ours(), peer()
    pairs = [(seconds(ours), seconds(peer)) for _ in range(ROUNDS)]
    mine, theirs = (statistics.median(times) for times in zip(*pairs, strict=True))
    return mine, theirs, statistics.median(b / a for a, b in pairs)


def rank_tests(decimals: int) -> tuple[float, float, float]:
    """28 tests of 10 against 10 values read to so many decimals; new values in every round, so that nothing is cached.

    With ties the peer deals 9999 times at random, without it is exact as ours.
    """
    rng = np.random.default_rng(1)
    rounds = [np.round(rng.normal(size=(28, 2, 10)), decimals) for _ in range(ROUNDS + 1)]
    ours, theirs = iter(rounds), iter(rounds)
    return interleaved(
        lambda: [rank_test([(a, b)]).p_greater for a, b in next(ours)],
        lambda: [(dealt if decimals < 3 else exact)(a, b) for a, b in next(theirs)],
    )


def dealt(a: Floats, b: Floats) -> float:
    """Return scipy's p-value from random deals of the pooled ranks, vectorised."""
    ranks = stats.rankdata(np.concatenate([b, a]))
    samples = ranks[: len(b)], ranks[len(b) :]

    def rank_sum(x: Floats, _: Floats, axis: int) -> Floats:
        return np.sum(x, axis=axis)

    test = stats.permutation_test(samples, rank_sum, vectorized=True, alternative="greater", n_resamples=9999, rng=1)
    return float(test.pvalue)


def exact(a: Floats, b: Floats) -> float:
    """Return scipy's exact p-value, which is right without ties."""
    return float(stats.mannwhitneyu(b, a, alternative="greater", method="exact").pvalue)


def bootstraps() -> tuple[float, float, float]:
    """28 intervals of a difference of medians of 10 against 10 values, 4000 resamples."""
    pairs = np.random.default_rng(2).normal(size=(28, 2, 10))

    def difference(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return np.median(x, axis=axis) - np.median(y, axis=axis)

    def theirs() -> object:
        return [
            stats.bootstrap((b, a), difference, n_resamples=4000, method="percentile", vectorized=True, rng=1)
            for a, b in pairs
        ]

    return interleaved(lambda: [median_difference_interval(a, b) for a, b in pairs], theirs)


def recordings(folder: Path) -> tuple[float, float, float]:
    """2400 poses into a recording."""
    t = np.arange(2400) / 240.0
    xyz = np.column_stack([np.cos(t), np.sin(t), 0.0 * t])

    def columns() -> None:
        recording = rr.RecordingStream("perf", recording_id="columns")
        recording.save(folder / "columns.rrd")
        index = [rr.TimeColumn("run_time", duration=t)]
        recording.send_columns("vehicle", indexes=index, columns=rr.Transform3D.columns(translation=xyz))
        recording.flush()

    def rows() -> None:
        recording = rr.RecordingStream("perf", recording_id="rows")
        recording.save(folder / "rows.rrd")
        for when, where in zip(t, xyz, strict=True):
            recording.set_time("run_time", duration=when)
            recording.log("vehicle", rr.Transform3D(translation=where))
        recording.flush()

    return interleaved(columns, rows)


def write_campaign(path: Path) -> Path:
    """Write 500 runs of 1200 poses: four trajectories under two conditions."""
    rng = np.random.default_rng(3)
    writer = CampaignWriter.create(
        path, CampaignHeader(1, "perf", "AGV", 0.18, 0.18, Channels.alike("us"), 120.0), durable=False
    )
    t = np.arange(POSES) / 120.0 - 1.0
    share = np.clip(t / 7.0, 0.0, 1.0)
    commands = Commands(np.array([0.0, 7.0]), np.array([900.0, 1500.0]), np.full(2, 1500.0), np.full(2, 1500.0))
    tracked, count, none = np.ones(POSES, np.bool_), np.arange(POSES), np.full(POSES, np.nan)
    cells = [(name, condition) for name in TARGETS for condition in ("uncalibrated", "calibrated")]
    for index in range(RUNS):
        (name, condition), repeat = cells[index % len(cells)], index // len(cells)
        target = np.array(TARGETS[name])
        end = target + (0.05 if condition == "uncalibrated" else 0.01) + 0.005 * rng.normal(size=3)
        x, y, heading = (share[:, None] * end + 3e-4 * rng.normal(size=(POSES, 3))).T
        frames = Frames(t, x, y, heading, tracked, count, none, none)
        facts = ("trajectory", name, condition, repeat, Pose(*target), 20.0 * index, "ok", "sim")
        writer.append(Run(f"r{index:03d}", *facts, commands, frames))
    return path


def report(campaign: Path) -> None:
    """Write the report as a user does."""
    subprocess.run([sys.executable, "-m", "agvbench", "report", campaign], check=True, stdout=subprocess.DEVNULL)  # noqa: S603


def main() -> int:
    """Print what | ours | peer | ratio | bound met?; return 0 if every bound is met."""
    table = Table(title="comparing and reporting (medians of interleaved rounds)")
    for heading in ("what", "ours", "peer", "ratio", "bound met?"):
        table.add_column(heading)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [
            ("28 rank tests with ties; peer: scipy permutation_test, 9999 deals", rank_tests(1), 1.0),
            ("28 rank tests without ties; peer: scipy exact mannwhitneyu", rank_tests(12), 1.0),
            ("28 bootstrap intervals; peer: scipy.stats.bootstrap", bootstraps(), 1.0),
            ("2400 poses into a recording; peer: log per row", recordings(folder), 10.0),
        ]
        met = []
        for what, (ours, peer, ratio), bound in rows:
            met.append(ratio >= bound)
            verdict = f"{'yes' if met[-1] else 'NO'} (≥ {bound:g})"
            table.add_row(what, f"{1e3 * ours:.1f} ms", f"{1e3 * peer:.1f} ms", f"{ratio:.1f}", verdict)
        campaign = write_campaign(folder / "campaign")
        took = statistics.median(seconds(lambda: report(campaign)) for _ in range(REPORT_ROUNDS))
        met.append(took < REPORT_BOUND_S)
        verdict = f"{'yes' if met[-1] else 'NO'} (< {REPORT_BOUND_S:g} s)"
        table.add_row(
            f"agvbench report of {RUNS} runs, the whole process (median of {REPORT_ROUNDS})",
            f"{took:.1f} s",
            "–",
            "–",
            verdict,
        )
    Console(width=130).print(table)
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
