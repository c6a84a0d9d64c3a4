"""How much faster than real time the default simulated campaign is driven: in process, and over TCP between processes.

The peer is real time: the simulated seconds of every run, at rest and driving, without the return path. Wall
time is from the first recorded run to the last, with planning, bus, plant, camera, quality, calibration and recording
(forced to disk); imports and compilation are given apart.
"""

from __future__ import annotations

import argparse
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
BOUND = 100.0


def _command(*arguments: str) -> list[str]:
    return [sys.executable, "-c", PROGRAM, *arguments]


def _drive(directory: Path, *more: str) -> tuple[float, float, float]:
    """Drive; return simulated seconds, the wall time they took, and the wall time of the whole process."""
    began = time.perf_counter()
    command = _command("bench", "--no-report", f"--out={directory}", *more)
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    whole_s = time.perf_counter() - began
    if done.returncode:
        raise SystemExit(done.stdout[-2000:] + done.stderr[-2000:])
    finished = sorted(path.stat().st_mtime for path in (directory / "runs.parquet").iterdir())
    runs = pd.read_parquet(directory / "runs.parquet").sort_values("started_s")
    # The first run's own time is not in the wall time, since only its end is known.
    return float(runs["duration_s"].iloc[1:].sum()), finished[-1] - finished[0], whole_s


def _over_tcp(directory: Path) -> tuple[float, float, float]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    endpoint = f"tcp/127.0.0.1:{port}"
    simulator = subprocess.Popen(_command("sim", "--listen", endpoint), stdout=subprocess.DEVNULL)  # noqa: S603
    try:
        while True:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.05)
        return _drive(directory, f"--connect={endpoint}")
    finally:
        simulator.terminate()
        simulator.wait()


def main() -> None:
    """Drive the default campaign both ways in turn and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    results: dict[str, list[tuple[float, float, float]]] = {"in process": [], "over TCP, two processes": []}
    with tempfile.TemporaryDirectory() as folder:
        _drive(Path(folder) / "warm-up", "--repeats=1")
        for number in range(rounds):
            results["in process"].append(_drive(Path(folder) / f"here{number}"))
            results["over TCP, two processes"].append(_over_tcp(Path(folder) / f"there{number}"))
    print(f"{'default campaign':26s}  simulated  driven in  × real time    process  bound  met?")
    for name, rows in results.items():
        simulated, driven, whole = (statistics.median(column) for column in zip(*rows, strict=True))
        ratio = statistics.median(row[0] / row[1] for row in rows)
        met = "yes" if ratio >= BOUND else "no"
        print(f"{name:26s} {simulated:8.0f} s {driven:8.1f} s {ratio:12.0f} {whole:8.1f} s  {BOUND:5.0f}  {met}")


if __name__ == "__main__":
    main()
