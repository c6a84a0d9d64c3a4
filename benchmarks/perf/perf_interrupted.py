"""Sessions that are stopped at random moments of their calibration and resumed, against undisturbed ones.

Each session is driven twice: once undisturbed, and once ended by SIGINT at a random moment of its calibration and then
resumed. Both must exit with 0 and agree byte for byte: the calibrated vehicle, and every run that counts.

    python benchmarks/perf/perf_interrupted.py --sessions 40 --out /tmp/interrupted
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
CALIBRATION_RUNS = 132
INTERRUPTED = 130
RANDOM = np.random.default_rng()


def start(directory: Path, seed: int, *more: str) -> subprocess.Popen[str]:
    """Begin a session that writes to `directory`."""
    options = [f"--seed={seed}", "--repeats=1", "--no-report", f"--out={directory}", *more]
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", PROGRAM, "bench", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # A shell has its background jobs ignore SIGINT, and so what they start.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509  (nothing else forks)
    )


def ended(session: subprocess.Popen[str], expected: int) -> str:
    """Wait for the end of a session; return what is wrong with it, "" for nothing."""
    output, _ = session.communicate(timeout=3600)
    return "" if session.returncode == expected else f"exit code {session.returncode}, not {expected}\n{output[-2000:]}"


def interrupt(session: subprocess.Popen[str], directory: Path, runs: int) -> None:
    """Send SIGINT a moment after `runs` runs were recorded."""
    while session.poll() is None and len(list(directory.glob("runs.parquet/[!.]*"))) < runs:
        time.sleep(0.01)
    time.sleep(RANDOM.uniform(0.0, 0.1))
    session.send_signal(signal.SIGINT)


def content(directory: Path) -> dict[str, bytes]:
    """Return the files that must be the same whether or not a session was interrupted."""
    files = [directory / "vehicle.toml", *directory.glob("*.parquet/[!.]*.parquet")]
    return {str(file.relative_to(directory)): file.read_bytes() for file in files if "-aborted" not in file.name}


def play(out: Path, seed: int) -> str:
    """Drive one session twice; return what is wrong, "" for nothing."""
    undisturbed, directory = out / "undisturbed" / str(seed), out / "interrupted" / str(seed)
    runs = int(RANDOM.integers(1, CALIBRATION_RUNS))
    if wrong := ended(start(undisturbed, seed), 0):
        return f"undisturbed: {wrong}"
    session = start(directory, seed)
    interrupt(session, directory, runs)
    if wrong := ended(session, INTERRUPTED):
        return f"interrupted after {runs} runs: {wrong}"
    if (directory / "vehicle.toml").exists():
        return f"interrupted after {runs} runs: vehicle.toml of an incomplete calibration"
    if wrong := ended(start(directory, seed, "--resume"), 0):
        return f"resumed after {runs} runs: {wrong}"
    before, now = content(undisturbed), content(directory)
    other = sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))
    return f"resumed after {runs} runs: {len(other)} files differ: {', '.join(other[:5])}" if other else ""


def main() -> int:
    """Play sessions with random seeds; return 1 if one of them went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=5)
    parser.add_argument("--out", type=Path, help="keep the campaigns here (default: a new temporary directory)")
    arguments = parser.parse_args()
    out = arguments.out or Path(tempfile.mkdtemp())
    failed = 0
    for _ in range(arguments.sessions):
        seed = int(RANDOM.integers(2**31))
        wrong = play(out, seed)
        failed += bool(wrong)
        print(f"seed {seed}: {wrong or 'as undisturbed'}", flush=True)
    print(f"{arguments.sessions - failed} of {arguments.sessions} sessions ended as undisturbed ones")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
