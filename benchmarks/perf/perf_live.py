"""What an observer costs a simulated bench: ``agvbench watch`` on its bus, and ``bench --live``, against neither.

Sessions of the same runs are driven in turn, each way once in a round, in a changing order. Wall time is that of the
runs, processor time that of the bench's own process with all its threads. Run with ``python
benchmarks/perf/perf_live.py [--rounds N] [--runs N]``.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from agvbench.reporting.viewer.process import live_view, viewer_command
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession

BOUND = 1.02
WATCH = [sys.executable, "-c", "import sys; from agvbench.cli import main; sys.exit(main())", "watch", "--json"]
SILENT: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def observer(port: int) -> Iterator[None]:
    with subprocess.Popen([*WATCH, "--connect", f"tcp/127.0.0.1:{port}"], stdout=subprocess.PIPE) as process:  # noqa: S603
        assert process.stdout is not None
        process.stdout.readline()  # from now on it gets every state
        process.stdout.close()
        yield
        process.send_signal(signal.SIGTERM)


@contextmanager
def sink(port: int) -> Iterator[None]:
    command = [*viewer_command(port), "--serve-grpc"]
    process = subprocess.Popen(command, start_new_session=True, **SILENT)  # noqa: S603
    try:
        end_s = time.monotonic() + 20.0
        while time.monotonic() < end_s:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def drive(opened: BenchSession, name: str, runs: int) -> tuple[float, float]:
    """Return wall and processor time of `runs` runs [s]."""
    began = time.perf_counter(), time.process_time()
    for number in range(runs):
        driver = opened.driver(f"{name}-{number}", experiment="trajectory", repeat=number + 1)
        driver.trajectory("57"[number % 2], condition="uncalibrated")
    return time.perf_counter() - began[0], time.process_time() - began[1]


def measure(way: str, runs: int, viewer: int) -> tuple[float, float]:
    port = free_port()
    listen = f"tcp/127.0.0.1:{port}" if way == "watch" else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "campaign")
        with open_session({"seed": 1}, out=str(path), resume=False, dry_run=False, listen=listen) as opened:
            drive(opened, "first", 2)  # what is loaded once
            views: dict[str, Callable[[], Any]] = {
                "neither": nullcontext,
                "watch": lambda: observer(port),
                "live": lambda: live_view(path, f"rerun+http://127.0.0.1:{viewer}/proxy", print),
            }
            with views[way]():
                if way == "live":
                    time.sleep(8.0)  # its imports are those of a bench's start
                return drive(opened, "run", runs)


def main() -> int:
    """Print the ratios; return 0 if every bound is met by processor time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--runs", type=int, default=40)
    given = parser.parse_args()
    ways = ["neither", "watch", "live"]
    rounds = []
    port = free_port()
    with sink(port):
        for number in range(given.rounds):
            order = ways[number % 3 :] + ways[: number % 3]
            rounds.append({way: measure(way, given.runs, port) for way in order})
            print({way: tuple(round(t, 2) for t in times) for way, times in rounds[-1].items()}, flush=True)
    print("what                     wall      processor   bound   met?")
    met = True
    for way in ways[1:]:
        wall, processor = (statistics.median(r[way][k] / r["neither"][k] for r in rounds) for k in (0, 1))
        met = met and processor <= BOUND
        print(f"{way:<20} {wall:8.3f}     {processor:8.3f}   {BOUND:6.2f}   {'yes' if processor <= BOUND else 'NO'}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
