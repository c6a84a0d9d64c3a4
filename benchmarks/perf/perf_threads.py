"""How much sooner a diagnosis ends where the simulation has several threads, and that its answer is the same.

The campaign is that of the default vehicle, unless one is given. It is diagnosed with one thread and with several in
turn, each in a process of its own. Times are those that a user waits, without the start of Python.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

BENCHMARKS = ("calibration", "trajectories", "step_response", "free_driving")
BENCH = "import sys; from agvbench.cli import main; sys.exit(main())"
DIAGNOSE = """
import sys, time
from agvbench.campaign import Campaign
from agvbench.diagnosis import diagnose
campaign = Campaign.open(sys.argv[1])
began = time.perf_counter()
found = diagnose(campaign)
print(time.perf_counter() - began)
print(found.verdict, found.effects, found.held_out)
"""


def python(program: str, *arguments: str, threads: int = 1) -> str:
    """Return what a program prints."""
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    environment = {**os.environ, **one, "NUMBA_NUM_THREADS": str(threads)}
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout  # noqa: S603


def main() -> int:
    """Print the times; 1 if an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaign", type=Path, help="by default one of the default vehicle is driven")
    parser.add_argument("--repeats", type=int, default=3, help="of each trajectory of that campaign (default 3)")
    parser.add_argument("--rounds", type=int, default=2, help="of both (default 2)")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)), help="default all processors")
    wanted = parser.parse_args()
    times: dict[int, list[float]] = {1: [], wanted.threads: []}
    answers = set()
    with tempfile.TemporaryDirectory() as folder:
        campaign = wanted.campaign or Path(folder) / "default"
        if wanted.campaign is None:
            python(BENCH, "bench", *BENCHMARKS, f"--repeats={wanted.repeats}", "--no-report", f"--out={campaign}")
        for _ in range(wanted.rounds):
            for threads, seconds in times.items():
                taken, _, answer = python(DIAGNOSE, str(campaign), threads=threads).partition("\n")
                seconds.append(float(taken))
                answers.add(answer)
                print(f"{threads} threads: {float(taken):.1f} s", flush=True)
    ratio = statistics.median(times[1]) / statistics.median(times[wanted.threads])
    same = "the same" if len(answers) == 1 else "not the same"
    print(f"{wanted.threads} threads: {ratio:.2f} times faster than one; the answer is {same}")
    return int(len(answers) > 1)


if __name__ == "__main__":
    sys.exit(main())
