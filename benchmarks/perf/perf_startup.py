"""How long ``agvbench --help`` takes beside ``python -c pass``, warm, whole processes in turn."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

RUNS = 15
BOUND_MS = 100.0


def _milliseconds(command: list[str]) -> float:
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
    return (time.perf_counter() - began) * 1e3


def main() -> None:
    """Print both medians and their difference."""
    bare = [sys.executable, "-c", "pass"]
    script = "import sys; from agvbench.cli import main; sys.exit(main(['--help']))"
    ours = [sys.executable, "-c", script]
    pairs = [(_milliseconds(ours), _milliseconds(bare)) for _ in range(RUNS + 1)][1:]
    ours_ms, bare_ms = (statistics.median(column) for column in zip(*pairs, strict=True))
    extra_ms = statistics.median(a - b for a, b in pairs)
    print("what                      ours      peer      extra    bound   met?")
    print(
        f"agvbench --help [ms]   {ours_ms:7.1f}   {bare_ms:7.1f}   {extra_ms:8.1f}   {BOUND_MS:6.0f}   "
        f"{'yes' if extra_ms <= BOUND_MS else 'no'}"
    )
    print("peer: python -c pass, same interpreter, pair by pair")


if __name__ == "__main__":
    main()
