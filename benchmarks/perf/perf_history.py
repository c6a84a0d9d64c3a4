"""The history of many campaigns: how long it takes, and how often steps are found, and found where there are none.

Campaigns on disk are written by agvbench's own writers; their runs are random numbers. Steps are looked for in nightly
values of random runs, in memory: 36 series (12 metrics under 3 conditions) of 60 nights, 8 trajectories with 3 repeats.
A step is in one series, at least 15 nights from either end, in units of the standard deviation of the nightly value.
Run with ``python benchmarks/perf/perf_history.py [--campaigns N] [--histories N]``.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from rich.console import Console
from rich.table import Table

from agvbench.campaign import CampaignHeader
from agvbench.campaign.header import FILE_NAME
from agvbench.campaign.manifest import record
from agvbench.campaign.tables.parquet import to_parquet
from agvbench.metrics import all_metrics
from agvbench.metrics.table import FILE
from agvbench.statistics.intervals import Proportion
from agvbench.statistics.steps.change_points import find_steps
from agvbench.types import Floats
from agvbench.vehicle.channels import Channels
from agvbench.workflows.history.nights import Nights
from agvbench.workflows.history.reading import history

RUNS, TRAJECTORIES, CONDITIONS = 366, 8, ("uncalibrated", "calibrated", "corrected")
SERIES, NIGHTS, REPEATS, MARGIN = 36, 60, 3, 15
REPEATABILITY = 2.0
"""In standard deviations of a nightly effect."""
SD = float(np.sqrt(1.0 + REPEATABILITY**2 * 0.4487 / TRAJECTORIES))
"""Of a nightly value: 0.4487 is the variance of the median of three standard normal values."""
ALPHA, MOST_FALSE, LEAST_FOUND, BOUND_S = 0.05, 0.05, 0.90, 3.0


def write_campaigns(folder: Path, count: int) -> None:
    """Write campaigns of 366 runs, one a night; the end position error of all runs steps in the middle."""
    rng = np.random.default_rng(0)
    runs = pd.DataFrame(
        {"run_id": f"run-{k:03d}", "experiment": "trajectory", "trajectory": str(1 + k % TRAJECTORIES),
         "condition": CONDITIONS[k // TRAJECTORIES % 3], "repeat": k // (3 * TRAJECTORIES), "session": "one",
         "firmware": "", "started_s": 20.0 * k, "status": "ok"}
        for k in range(RUNS)
    )  # fmt: skip
    metrics = list(all_metrics().values())
    table = pd.concat([runs.assign(metric=m.name, value=0.0, unit=m.unit) for m in metrics]).sort_values(
        "run_id", kind="stable"
    )
    for night in range(count):
        values = 20.0 + rng.normal(size=len(metrics))[np.arange(len(table)) % len(metrics)]
        values += 3.0 * rng.normal(size=len(table))
        values[(table["metric"] == "position_error") & (night >= count // 2)] += 5.0
        firmware = "2.1" if night >= count // 2 else "2.0"
        write_campaign(folder / f"night-{night:04d}", table.assign(value=values, firmware=firmware), night)


def write_campaign(path: Path, metrics: pd.DataFrame, night: int) -> None:
    """Write the head, the provenance and the metrics of a campaign, and hashes of the parts that it would have."""
    path.mkdir()
    CampaignHeader(1, path.name, "AGV", 0.18, 0.18, Channels.alike("us"), 120.0).save(path / FILE_NAME)
    began = datetime(2024, 1, 1, 22, tzinfo=UTC) + timedelta(days=night)
    facts = pd.DataFrame({"name": ["began", "agvbench"], "value": [began.isoformat(), "0.2.0"]})
    record(path, {"provenance.parquet": to_parquet(pa.Table.from_pandas(facts, preserve_index=False))}, durable=False)
    with (path / "SHA256SUMS").open("a", encoding="utf-8") as hashes:
        hashes.writelines(f"{k:064x}  {name}.parquet/run-{k:03d}.parquet\n" for name in ("runs", "commands", "poses")
                          for k in range(RUNS))  # fmt: skip
    content = pa.Table.from_pandas(metrics, preserve_index=False).replace_schema_metadata(None)
    record(path, {FILE: to_parquet(content)}, durable=False)  # as write_metrics does, without waiting for the disk


@dataclass(frozen=True)
class Noise:
    """How nights vary: autocorrelation of successive ones, and degrees of freedom of Student's t (0: normal)."""

    correlation: float = 0.0
    freedom: int = 0

    def nights(self, rng: np.random.Generator, nights: int) -> Floats:
        """Return nightly effects of variance 1, shape (series, nights); half of the variance is common to all."""
        added = np.sqrt(0.5) * (self._draw(rng, (SERIES, nights)) + self._draw(rng, (nights,)))
        effects = added.copy()
        for k in range(1, nights):
            effects[:, k] = self.correlation * effects[:, k - 1] + np.sqrt(1.0 - self.correlation**2) * added[:, k]
        return effects

    def _draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
        if not self.freedom:
            return rng.normal(size=shape)
        return rng.standard_t(self.freedom, size=shape) / np.sqrt(self.freedom / (self.freedom - 2.0))


def nightly(rng: np.random.Generator, noise: Noise, step: float, at: int, nights: int) -> Floats:
    """Return the values of random runs, shape (series, nights); series 0 steps by `step` before night `at`."""
    effects = noise.nights(rng, nights)
    effects[0, at:] += step * SD
    runs = 50.0 + effects[:, np.newaxis, :, np.newaxis]
    runs = runs + REPEATABILITY * rng.normal(size=(SERIES, TRAJECTORIES, nights, REPEATS))
    median = np.median(np.abs(runs), axis=3)
    none = np.full(median.shape, np.nan)
    return Nights((), (), np.full(median.shape, REPEATS), median, none).value


def steps_found(histories: int, size: float, within: int, noise: Noise) -> tuple[Proportion, Proportion, Proportion]:
    """Return how often a step is found within so many nights, is in its interval, and any other is found."""
    near, covered, others = [], [], []
    rng = np.random.default_rng(int(10 * size))
    for _ in range(histories):
        at = int(rng.integers(MARGIN, NIGHTS - MARGIN + 1))
        of = find_steps(nightly(rng, noise, size, at, NIGHTS), alpha=ALPHA).of
        nearest = min(of[0], key=lambda step: abs(step.night - at), default=None)
        near.append(nearest is not None and abs(nearest.night - at) <= within)
        covered += [] if nearest is None else [nearest.earliest <= at <= nearest.latest]
        others.append(len(of[0]) > 1 or any(of[1:]))
    return Proportion.of(near), Proportion.of(covered), Proportion.of(others)


def false_steps(histories: int, noise: Noise, nights: int) -> Proportion:
    """Return how often any step is found in any of the series where there is none."""
    rng = np.random.default_rng(1)
    return Proportion.of(any(find_steps(nightly(rng, noise, 0.0, 0, nights), alpha=ALPHA).of) for _ in range(histories))


def seconds(folder: Path) -> Iterator[tuple[str, float]]:
    """Yield what was done and its time [s]: the history in a warm process, and the command."""
    with tempfile.TemporaryDirectory() as few:
        write_campaigns(Path(few), 12)
        history(few)
    began = time.perf_counter()
    history(folder)
    yield (
        f"agvbench.history of {len(list(folder.iterdir()))} campaigns × {RUNS} runs, none read before",
        time.perf_counter() - began,
    )
    times = []
    for night in range(3):
        os.utime(folder / f"night-{night:04d}" / FILE)
        began = time.perf_counter()
        found = history(folder)
        times.append(time.perf_counter() - began)
    assert "firmware 2.0 → 2.1" in {fact for facts in found.changes["facts"] for _, fact in facts}
    yield "the same with one campaign that is new, best of 3", min(times)
    began = time.perf_counter()
    command = [sys.executable, "-m", "agvbench", "history", str(folder)]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    yield "the command: imports, page with a chart per metric, parquet", time.perf_counter() - began


def main() -> int:
    """Print what | measured | bound met?; return 0 if every bound is met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=1000)
    parser.add_argument("--histories", type=int, default=500)
    given = parser.parse_args()
    table = Table(title="history of campaigns")
    for heading in ("what", "measured", "bound met?"):
        table.add_column(heading)
    met = []

    def add(what: str, measured: str, bound: str = "", *, is_met: bool = True) -> None:
        met.append(is_met)
        table.add_row(what, measured, f"{'yes' if is_met else 'NO'} ({bound})" if bound else "–")

    with tempfile.TemporaryDirectory() as name:
        write_campaigns(Path(name), given.campaigns)
        for k, (what, took) in enumerate(seconds(Path(name))):
            add(what, f"{took:.1f} s", f"≤ {BOUND_S:g} s" if k == 1 else "", is_met=k != 1 or took <= BOUND_S)
    for size, within, noise in ((2.5, 1, Noise()), (2.0, 2, Noise()), (2.0, 2, Noise(0.3))):
        near, covered, others = steps_found(given.histories, size, within, noise)
        bound = "" if noise.correlation else f"≥ {LEAST_FOUND:.0%}"
        what = f"step of {size:g} sd found within ± {within} (autocorrelation {noise.correlation:g})"
        add(what, shown(near), bound, is_met=not bound or near.value >= LEAST_FOUND)
        add("  its night is in the 95 % interval; any other step", f"{shown(covered)}; {shown(others)}")
    for noise, nights in ((Noise(), 60), (Noise(), 365), (Noise(freedom=3), 60), (Noise(0.3), 60), (Noise(0.5), 60)):
        share = false_steps(given.histories, noise, nights)
        kind = f"Student's t, {noise.freedom} degrees of freedom" if noise.freedom else "normal"
        what = f"any false step, {nights} nights, {kind}, autocorrelation {noise.correlation:g}"
        bound = "" if noise.correlation else f"≤ {MOST_FALSE:.0%}"
        add(what, shown(share), bound, is_met=not bound or share.value <= MOST_FALSE)
    Console(width=130).print(table)
    return 0 if all(met) else 1


def shown(share: Proportion) -> str:
    """Return a share with its 95 % interval."""
    return f"{share.value:.1%} ({share.low:.1%} to {share.high:.1%}) of {share.total}"


if __name__ == "__main__":
    sys.exit(main())
