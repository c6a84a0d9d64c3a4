"""The bench sessions of a loop, each in its own process; the second finds a plant as it was built."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from agvbench.errors import AgvbenchError
from agvbench.running.configuration.campaign_directory import has_session
from agvbench.running.configuration.settings import SETTINGS_FILE, BenchSettings
from agvbench.running.session.termination_signals import Terminated, interruptible

_PROGRAM = (
    "import json, sys; from agvbench.workflows.bench import run_benchmarks;"
    " sys.exit(run_benchmarks(*json.loads(sys.argv[1]), summary=False))"
)
_DONE = {0, 1}  # 1: some run was never driven well enough; what was is a campaign all the same
_ERROR = "ERROR: "

OnProgress = Callable[[str], None]


def drive(
    directory: Path, names: Sequence[str], settings: BenchSettings, more: Mapping[str, str], on_progress: OnProgress
) -> None:
    """Drive the benchmarks `names` in a process of its own, on from where it was interrupted.

    Parameters
    ----------
    directory
        The campaign's.
    names
        Benchmarks.
    settings, more
        What the loop was asked for, and options that it sets itself.
    on_progress
        Called if some runs could not be driven.

    Raises
    ------
    AgvbenchError
        If it cannot be driven.
    """
    options = {name: value for name, value in asdict(settings).items() if value != getattr(BenchSettings(), name)}
    options |= {**more, "out": str(directory), "resume": has_session(directory), "no_report": True}
    code, errors = _run([sys.executable, "-c", _PROGRAM, json.dumps([names, options])])
    if code not in _DONE:
        raise AgvbenchError(errors[-1] if errors else f"the bench ended with exit code {code}")
    for error in errors:
        sys.stderr.write(f"{error}\n")
    if code:
        on_progress(f"    some runs could not be driven: agvbench report {directory} says which")


def _run(command: Sequence[str]) -> tuple[int, list[str]]:
    """Run a bench; return its exit code, and why it failed. What it asks of an operator is passed on at once."""
    errors: list[str] = []
    with interruptible(), subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603 - ours
        try:
            for line in process.stderr or ():
                if line.startswith(_ERROR):
                    errors.append(line.removeprefix(_ERROR).strip())
                elif line.strip():
                    sys.stderr.write(line)
        except KeyboardInterrupt as interrupt:
            _end(process, interrupt)
            raise
    return process.returncode, errors


def _end(process: subprocess.Popen[str], interrupt: KeyboardInterrupt) -> None:
    """Let the bench stop its vehicle and record what it has seen, when the loop is to end.

    What was sent to the loop alone is sent on, once: nothing may come between the vehicle and its stop.
    """
    if isinstance(interrupt, Terminated):
        process.send_signal(interrupt.number)
    elif not _in_front():
        process.send_signal(signal.SIGINT)
    process.communicate()


def _in_front() -> bool:
    """Return whether a terminal's Ctrl-C goes to this process, and so to the bench, too."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError):
        return False  # there is no terminal


def moved(directory: Path, models: Mapping[str, str]) -> None:
    """Let a session that goes on find its models, which lie beside it, wherever the loop has been moved."""
    if (directory / SETTINGS_FILE).exists():
        began = BenchSettings.load(directory)
        calibration, corrected, bias_corrections = (models[name] for name in ("calibration", "corrected", "remainders"))
        replace(began, calibration=calibration, corrected=corrected, remainders=bias_corrections).save(directory)
