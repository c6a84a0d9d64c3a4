"""How well free driving of vehicles by other authors is predicted: cars driven by hand, and robots with two sides.

``benchmarks/independent/driven_cars.py`` and ``driven_robots.py`` write recordings of several days as a lab would, with
a mapping. They are imported and diagnosed as they are: whole days are the test. Printed for each vehicle: the error of
position at the horizon on the test windows, of static maps in mm, and of the other predictors relative to it; the error
due to noise; effects that were kept, and those of them that made this error larger. `population` is the model found
without what is estimated from earlier windows of a recording. A vehicle that is refused has the reason in place of
figures.
Run with ``python benchmarks/perf/perf_driven.py [--cars FIRST LAST] [--robots FIRST LAST] [--json FILE]``.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from agvbench.campaign import import_recordings
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.errors import AgvbenchError

SIMULATORS = Path(__file__).resolve().parents[1] / "independent"
PREDICTORS = ("speed_held", "naive", "population", "after")


def judged(found: Diagnosis) -> dict[str, Any]:
    """Return the errors at the horizon on all test windows [mm], and the effects that were kept."""
    windows = found.provenance["windows"]
    rows = [row for row in windows["recordings"] if row["held_out"]]
    ahead = [next(row[key] for key in reversed(row) if key.startswith("ahead_")) for row in rows]
    count = [row["windows"] for row in rows]

    def error(name: str) -> float:
        return math.sqrt(np.average([one[f"{name}_mm"]["rms"] ** 2 for one in ahead], weights=count))

    kept = {name: entry["held_out_position_mm"] for name, entry in windows["effects"].items() if entry["kept"]}
    worse = [name for name, errors in kept.items() if errors["with"] > errors["without"]]
    noise = math.sqrt(np.average([one["floor_mm"] ** 2 for one in ahead], weights=count))
    errors = {name: error(name) for name in ("static", *PREDICTORS)}
    return {"windows": sum(count), "noise": noise, **errors, "kept": list(kept), "worse": worse}


def vehicle(script: Path, number: int) -> dict[str, Any]:
    """Write the recordings of a vehicle, import and diagnose them, and return what came out."""
    with tempfile.TemporaryDirectory() as directory:
        drives = Path(directory) / "drives"
        command = [sys.executable, str(script), "write", str(drives), "--vehicle", str(number)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
        begin = time.process_time()
        try:
            files = sorted(drives.glob("*.csv"))
            found = diagnose(import_recordings(str(drives / "mapping.toml"), files, Path(directory) / "campaign"))
            result = judged(found)
        except AgvbenchError as error:
            result = {"refused": str(error)}
    return {"simulator": script.stem, "vehicle": number, "cpu_s": time.process_time() - begin, **result}


def _chosen(wanted: argparse.Namespace) -> Iterator[tuple[Path, int]]:
    for name, ends in (("driven_cars", wanted.cars), ("driven_robots", wanted.robots)):
        for number in range(ends[0], ends[1] + 1) if ends else ():
            yield SIMULATORS / f"{name}.py", number


def _row(result: dict[str, Any]) -> list[str]:
    name = f"{result['simulator']} {result['vehicle']}"
    if "refused" in result:
        return [name, "–", "–", "–", *["–"] * len(PREDICTORS), f"{result['cpu_s']:.0f}", result["refused"], ""]
    ratios = [f"{result[one] / result['static']:.2f}" for one in PREDICTORS]
    figures = [f"{result['windows']}", f"{result['noise']:.0f}", f"{result['static']:.0f}", *ratios]
    return [name, *figures, f"{result['cpu_s']:.0f}", ", ".join(result["kept"]) or "none", ", ".join(result["worse"])]


def summary(results: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield what holds of how many vehicles."""
    judged = [result for result in results if "refused" not in result]
    if not judged:
        return
    yield f"{len(judged)} of {len(results)} vehicles diagnosed"
    for name in ("population", "after"):
        ratio = np.array([result[name] / result["static"] for result in judged])
        beats = [result[name] < min(result["static"], result["speed_held"], result["naive"]) for result in judged]
        half = f"{np.count_nonzero(ratio <= 0.5)} at half the error of static maps or less"
        below = f"{sum(beats)} below static maps, those at the measured speed, and constant velocity"
        yield f"{name}: {half} (median {np.median(ratio):.2f}); {below}"
    kept, worse = (sum(len(result[key]) for result in judged) for key in ("kept", "worse"))
    yield f"{kept} effects kept, {worse} of which made the error on the test windows larger"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each vehicle, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cars", nargs=2, type=int, metavar=("FIRST", "LAST"))
    parser.add_argument("--robots", nargs=2, type=int, metavar=("FIRST", "LAST"))
    parser.add_argument("--json", type=Path, metavar="FILE", help="a line for each vehicle")
    wanted = parser.parse_args(arguments)
    results = []
    for script, number in _chosen(wanted):
        results.append(vehicle(script, number))
        print(_row(results[-1]), flush=True)
        if wanted.json:
            wanted.json.write_text("".join(json.dumps(result) + "\n" for result in results))
    columns = ("vehicle", "windows", "due to noise", "static, mm", *PREDICTORS, "CPU, s", "kept", "larger with it")
    table = Table(*columns, box=MARKDOWN)
    for result in results:
        table.add_row(*_row(result))
    Console(width=220).print(table)
    for line in summary(results):
        print(line)


if __name__ == "__main__":
    main()
