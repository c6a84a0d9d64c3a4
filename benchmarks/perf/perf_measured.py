"""How well free driving of other labs' vehicles is predicted where nothing was fitted.

Each vehicle's recordings are split as in `SPLITS`. Printed for each recording held out: position error 1 s and 2 s
ahead, with 95 % intervals over stretches, for the error due to noise, the static maps, those with the measured speed
held, constant velocity, and the model found; and for each effect what it does to what was held out. At the end, the
error 2 s ahead relative to the static maps. The recordings are looked for in ``$AGVBENCH_MEASURED``, else in a folder
``shared/measured`` beside the project's. Run with ``python benchmarks/perf/perf_measured.py [VEHICLE ...]
[--brief] [--markdown] [--figures DIR]``; a figure VEHICLE.svg is written for each vehicle.
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

from rich.box import HEAVY_HEAD, MARKDOWN, Box
from rich.console import Console
from rich.table import Table

from agvbench.campaign import Campaign, CampaignHeader, import_recordings
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.reporting.errors_by_recording import recorded_errors
from agvbench.types import Run

ROOT = Path(__file__).resolve().parents[2]
PREDICTORS = {"static": "static", "speed_held": "speed held", "naive": "naive", "after": "found"}


class Split:
    """A campaign of which some runs are held out."""

    def __init__(self, campaign: Campaign, held: Held) -> None:
        self.header: CampaignHeader = campaign.header
        self._runs = [dataclasses.replace(run, split="held_out" if held.holds(run) else "fit") for run in campaign]

    def __iter__(self) -> Iterator[Run]:
        return iter(self._runs)


@dataclasses.dataclass(frozen=True)
class Held:
    """What is held out of a recording: files whose name contains a text, or the runs after the first ones."""

    title: str
    files: tuple[str, ...] = ()
    after_runs: int | None = None

    def holds(self, run: Run) -> bool:
        """Return whether `run` is held out."""
        if self.after_runs is not None:
            return int(run.run_id.rpartition("-")[2]) > self.after_runs
        return any(text in str(run.extra["source"]) for text in self.files)


SPLITS = {
    "cpm": [Held("a, then b", ("_b",)), Held("b, then a", ("_a",))],
    "eth": [Held("the last third", after_runs=10)],
    "warthog": [Held("29 July, then 8 August", ("august",)), Held("8 August, then 29 July", ("july",))],
    "dart": [
        Held("19 July", ("racetrack",)),
        Held("16 September", ("free_driving",)),
        Held("both days", ("racetrack", "free_driving")),
    ],
}


def recordings(vehicle: str) -> list[Path]:
    where = os.environ.get("AGVBENCH_MEASURED")
    return sorted((Path(where) if where else ROOT.parent / "shared" / "measured").glob(f"{vehicle}/*.csv"))


def report(
    console: Console, title: str, found: Diagnosis, seconds: float, *, brief: bool, style: Box
) -> list[dict[str, Any]]:
    console.print(f"\n{title} ({seconds:.0f} s): {found.verdict}")
    for effect in found.effects:
        values = ", ".join(f"{name} {e.value:.3g} ± {e.stderr:.2g} {e.unit}" for name, e in effect.parameters.items())
        others = f"; or {', '.join(effect.confounded_with)}" if effect.confounded_with else ""
        console.print(f"  {effect.name}: {values}{others}")
    windows = found.provenance["windows"]
    table = Table("recording", "ahead", "windows", "floor", *PREDICTORS.values(), title="position error, mm", box=style)
    rows = [row for row in windows["recordings"] if row["held_out"]]
    for row in (row for row in recorded_errors({"provenance": found.provenance}) if row.is_test):
        label = f"  {row.part} the training commands" if row.part else row.recording
        cells = [_cell(*row.error_mm(name)) for name in PREDICTORS]
        table.add_row(label, row.ahead, f"{row.windows:.0f}", f"{row.floor_mm:.0f}", *cells)
    console.print(table)
    if brief:
        return rows
    columns = ("effect", "kept", "gain", "error with it", "without")
    each = Table(*columns, title="effects on what was held out, mm", box=style)
    for name, entry in windows["effects"].items():
        errors = entry["held_out_position_mm"]
        word = "yes" if entry["kept"] else "no: extrapolates" if entry["extrapolates"] else "no"
        cells = ["–" if errors[key] is None else f"{errors[key]:.0f}" for key in ("with", "without")]
        each.add_row(name, word, f"{entry['gain']:.1f}", *cells)
    console.print(each)
    return rows


def _cell(rms: float, low: float, high: float) -> str:
    return f"{rms:.0f}" + ("" if math.isnan(low) else f" ({low:.0f}…{high:.0f})")


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
    axes.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def summary(rows: Sequence[tuple[str, list[dict[str, Any]]]], style: Box) -> Table:
    """Return the errors 2 s ahead of each split, over all its windows, relative to the static maps.

    Windows with commands within and beyond the range of the training windows have rows of their own.
    """
    columns = ("split", "windows", "static, mm", *list(PREDICTORS.values())[1:])
    table = Table(*columns, title="relative to the static maps", box=style)
    for title, recorded in rows:
        within = [row.get("within", row) for row in recorded if "within" in row or "beyond" not in row]
        beyond = [row["beyond"] for row in recorded if "beyond" in row]
        table.add_row(title, *_relative(recorded))
        for label, part in (("within", within), ("beyond", beyond)) if beyond else ():
            table.add_row(f"  {label} the training commands", *(_relative(part) if part else ()))
    return table


def _relative(rows: Sequence[dict[str, Any]]) -> list[str]:
    count = sum(row["windows"] for row in rows)
    error = {
        name: math.sqrt(sum(row["windows"] * row["ahead_2_s"][f"{name}_mm"]["rms"] ** 2 for row in rows) / count)
        for name in PREDICTORS
    }
    ratios = [f"{error[name] / error['static']:.2f}" for name in list(PREDICTORS)[1:]]
    return [str(count), f"{error['static']:.0f}", *ratios]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicles", nargs="*", default=list(SPLITS), metavar="VEHICLE")
    parser.add_argument("--brief", action="store_true")
    parser.add_argument("--markdown", action="store_true", help="tables in Markdown")
    parser.add_argument("--figures", type=Path, metavar="DIR")
    wanted = parser.parse_args(arguments)
    console, style = Console(width=None if sys.stdout.isatty() else 150), MARKDOWN if wanted.markdown else HEAVY_HEAD
    total: list[tuple[str, list[dict[str, Any]]]] = []
    for vehicle in wanted.vehicles:
        if not (files := recordings(vehicle)):
            console.print(f"no recordings: set AGVBENCH_MEASURED to the directory that has {vehicle}/*.csv")
            return 2
        with tempfile.TemporaryDirectory() as directory:
            campaign = import_recordings(vehicle, files, Path(directory) / vehicle)
            drawn: dict[str, dict[str, Any]] = {}
            for held in SPLITS[vehicle]:
                begin = time.perf_counter()
                found = diagnose(Split(campaign, held))
                title = f"{vehicle}: {held.title}"
                rows = report(console, title, found, time.perf_counter() - begin, brief=wanted.brief, style=style)
                total.append((title, rows))
                drawn = {row["recording"]: row for row in rows} | drawn  # of several splits, the first
        if wanted.figures:
            draw(list(drawn.values()), wanted.figures / f"{vehicle}.svg")
    console.print(summary(total, style))
    return 0


if __name__ == "__main__":
    sys.exit(main())
