"""How well free driving is predicted on days that were not fitted to: the DART recordings.

Each of the smaller days is held out in turn, then both together. Printed for each recording held out: position error
1 s and 2 s ahead, with 95 % intervals over stretches, for the floor, the static maps, those with the measured speed
held, the naive predictor, and the model found; and for each effect what it does to the days held out. The recordings
are looked for in ``$AGVBENCH_MEASURED``, else in a folder ``shared/measured`` beside the project's. Run with
``python benchmarks/perf/perf_dart.py [--figure FILE.svg]``.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from agvbench.campaign import Campaign, CampaignHeader, import_recordings
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.types import Run

ROOT = Path(__file__).resolve().parents[2]
PREDICTORS = {"static": "static", "speed_held": "speed held", "naive": "naive", "after": "found"}


class Split:
    """A campaign whose runs of some sessions are held out."""

    def __init__(self, campaign: Campaign, held: Sequence[str]) -> None:
        self.header: CampaignHeader = campaign.header
        self._runs = [dataclasses.replace(run, split="held_out" if run.session in held else "fit") for run in campaign]

    def __iter__(self) -> Iterator[Run]:
        return iter(self._runs)


def recordings() -> list[Path]:
    where = os.environ.get("AGVBENCH_MEASURED")
    return sorted((Path(where) if where else ROOT.parent / "shared" / "measured").glob("dart/*.csv"))


def smaller_days(campaign: Campaign) -> list[str]:
    """Return the sessions but the one with most frames."""
    frames: dict[str, int] = {}
    for run in campaign:
        frames[str(run.session)] = frames.get(str(run.session), 0) + len(run.frames)
    return sorted(frames, key=lambda name: frames[name])[:-1]


def report(console: Console, held: Sequence[str], found: Diagnosis, seconds: float) -> list[dict[str, Any]]:
    console.print(f"\nheld out: {', '.join(held)} ({seconds:.0f} s): {found.verdict}")
    for effect in found.effects:
        values = ", ".join(f"{name} {e.value:.3g} ± {e.stderr:.2g} {e.unit}" for name, e in effect.parameters.items())
        others = f"; or {', '.join(effect.confounded_with)}" if effect.confounded_with else ""
        console.print(f"  {effect.name}: {values}{others}")
    windows = found.provenance["windows"]
    table = Table("recording", "ahead", "windows", "floor", *PREDICTORS.values(), title="position error, mm")
    rows = [row for row in windows["recordings"] if row["held_out"]]
    for row in rows:
        for key in (key for key in row if key.startswith("ahead_")):
            cells = [_cell(row[key][f"{name}_mm"]) for name in PREDICTORS]
            ahead = key.removeprefix("ahead_").replace("_", " ")
            table.add_row(row["recording"], ahead, str(row["windows"]), f"{row[key]['floor_mm']:.0f}", *cells)
    console.print(table)
    each = Table("effect", "kept", "gain", "error with it", "without", title="effects on the days held out, mm")
    for name, entry in windows["effects"].items():
        errors = entry["held_out_position_mm"]
        word = "yes" if entry["kept"] else "no: extrapolates" if entry["extrapolates"] else "no"
        cells = ["–" if errors[key] is None else f"{errors[key]:.0f}" for key in ("with", "without")]
        each.add_row(name, word, f"{entry['gain']:.1f}", *cells)
    console.print(each)
    return rows


def _cell(error: dict[str, float]) -> str:
    low, high = error["low"], error["high"]
    return f"{error['rms']:.0f}" + ("" if math.isnan(low) else f" ({low:.0f}…{high:.0f})")


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the errors 2 s ahead of recordings held out, a group of bars for each."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
    for k, (name, label) in enumerate(PREDICTORS.items()):
        errors = [row["ahead_2_s"][f"{name}_mm"] for row in rows]
        heights = [e["rms"] for e in errors]
        spread = [
            [max(e["rms"] - e["low"], 0.0) if math.isfinite(e["low"]) else 0.0 for e in errors],
            [max(e["high"] - e["rms"], 0.0) if math.isfinite(e["low"]) else 0.0 for e in errors],
        ]
        places = [i + 0.2 * (k - 1.5) for i in range(len(rows))]
        axes.bar(places, heights, 0.18, yerr=spread, label=label, capsize=2)
    axes.set_xticks(range(len(rows)), [Path(row["recording"]).stem for row in rows])
    axes.set_ylabel("position error 2 s ahead, mm (rms)")
    axes.legend(frameon=False, ncols=4)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figure", type=Path, metavar="FILE")
    wanted = parser.parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 150)
    files = recordings()
    if not files:
        console.print("no DART recordings: set AGVBENCH_MEASURED to the directory that has dart/*.csv")
        return 2
    drawn: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as directory:
        campaign = import_recordings("dart", files, Path(directory) / "dart")
        days = smaller_days(campaign)
        for held in [*([day] for day in days), days]:
            begin = time.perf_counter()
            found = diagnose(Split(campaign, held))
            rows = report(console, held, found, time.perf_counter() - begin)
            drawn += rows if len(held) == 1 else []
    if wanted.figure:
        draw(drawn, wanted.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
