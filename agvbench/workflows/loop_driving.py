"""The bench sessions of a loop, each in a process of its own: one drives, the next finds a plant as it was built."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from agvbench.errors import AgvbenchError
from agvbench.running.settings import SETTINGS_FILE, BenchSettings

_PROGRAM = (
    "import json, sys; from agvbench.workflows.bench import run_benchmarks;"
    " sys.exit(run_benchmarks(*json.loads(sys.argv[1]), summary=False))"
)
_DONE = {0, 1}  # 1: some run was never driven well enough; what was is a campaign all the same

Tell = Callable[[str], None]


def drive(directory: Path, names: Sequence[str], settings: BenchSettings, more: Mapping[str, str], tell: Tell) -> None:
    """Drive the benchmarks `names` in a process of its own, on from where it was interrupted.

    Parameters
    ----------
    directory
        The campaign's.
    names
        Benchmarks.
    settings, more
        What the loop was asked for, and options that it sets itself.
    tell
        Called if some runs could not be driven.

    Raises
    ------
    AgvbenchError
        If it cannot be driven.
    """
    options = {name: value for name, value in asdict(settings).items() if value != getattr(BenchSettings(), name)}
    options |= {**more, "out": str(directory), "resume": directory.exists(), "no_report": True}
    command = [sys.executable, "-c", _PROGRAM, json.dumps([names, options])]
    errors = ""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603 - our own program
        try:
            errors = process.communicate()[1]
        except KeyboardInterrupt:
            # It was interrupted as well, stops the vehicle, and records what it has seen.
            process.wait()
            raise
    if process.returncode not in _DONE:
        said = [line.removeprefix("ERROR: ") for line in errors.splitlines() if line.strip()]
        raise AgvbenchError(said[-1] if said else f"the bench ended with exit code {process.returncode}")
    if errors:
        sys.stderr.write(errors)
    if process.returncode:
        tell(f"    some runs could not be driven: agvbench report {directory} says which")


def moved(directory: Path, models: Mapping[str, str]) -> None:
    """Let a session that goes on find its models, which lie beside it, wherever the loop has been moved."""
    if (directory / SETTINGS_FILE).exists():
        began = BenchSettings.load(directory)
        calibration, corrected, remainders = (models[name] for name in ("calibration", "corrected", "remainders"))
        replace(began, calibration=calibration, corrected=corrected, remainders=remainders).save(directory)
