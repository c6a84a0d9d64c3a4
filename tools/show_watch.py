"""Print what ``agvbench watch`` draws at a terminal of 100 columns: ``python tools/show_watch.py``, for the how-to.

A bench in a process of its own drives two trajectories in real time; the view is that of its fourth run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console

from agvbench.bus.messages.runner_state import Phase, RunnerState
from agvbench.reporting.console.state_view import view
from agvbench.workflows.watch import watched_states

ENDPOINT = "tcp/127.0.0.1:7447"
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
BENCH = ["bench", "trajectories", "--trajectories", "5,6", "-k", "uncalibrated", "--repeats", "2", "--no-report"]


def _is_fourth(state: RunnerState) -> bool:
    return state.counted == 3 and state.phase is Phase.DRIVING and state.run is not None and state.run.t_s > 2.0


def main() -> int:
    """Print the view; return the bench's exit code."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PROGRAM, *BENCH, "--agv", "live", "--listen", ENDPOINT]
        command += ["--out", str(Path(folder, "monday"))]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as bench:  # noqa: S603
            with watched_states(ENDPOINT, wait_s=60.0) as watched:
                shown = next(state for state in watched.states if state and _is_fourth(state))
                Console(width=100).print(view(watched.name, shown))
            return bench.wait()


if __name__ == "__main__":
    sys.exit(main())
