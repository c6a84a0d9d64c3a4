"""``agvbench loop``: bench, diagnose, correct the model, plan with it, try the plans, bench again.

Each stage leaves its result in the loop's directory, and a stage whose result is there is not done again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agvbench.errors import AgvbenchError
from agvbench.loop.sessions import OnProgress, drive
from agvbench.loop.settings import AFTER, BEFORE, DIAGNOSIS, PLANS, SETTINGS, VEHICLE, opened
from agvbench.loop.stages import diagnosed, drive_corrected, learned, planned
from agvbench.running.configuration.benchmark_files import EXCITATION_RUNS
from agvbench.running.configuration.settings import BenchSettings

SHOWING = ("trajectories",)
"""What the second session drives."""


@dataclass(frozen=True)
class Loop:
    """A loop that was driven.

    Parameters
    ----------
    directory
        Where everything is.
    settings
        What it was asked for.
    diagnosis
        The content of ``diagnosis.json``.
    plans
        The content of ``plans.json``: what corrected plans compensate, by trajectory.
    """

    directory: Path
    settings: BenchSettings
    diagnosis: Mapping[str, Any]
    plans: Mapping[str, Any]

    @property
    def before(self) -> Path:
        """The campaign that was diagnosed."""
        return self.directory / BEFORE

    @property
    def after(self) -> Path:
        """The campaign that compares the conditions."""
        return self.directory / AFTER


def run_loop(
    given: Mapping[str, Any], *, out: str | None, resume: bool, on_progress: OnProgress = lambda _: None
) -> Loop:
    """Go round the loop, or on from where it was interrupted.

    Parameters
    ----------
    given
        Options of a bench session by name; those that are None are as usual.
    out
        The directory; a new one under ``campaigns/`` by default.
    resume
        Whether to go on in it.
    on_progress
        Called with a line whenever there is progress.

    Raises
    ------
    AgvbenchError
        If an option, the plant, a campaign or a file cannot be used.
    """
    directory, settings = opened(given, out, resume=resume)
    on_progress(f"1/5 driving to diagnose: {', '.join(EXCITATION_RUNS)} → {directory / BEFORE}")
    if not (directory / DIAGNOSIS).exists():
        _first_bench(directory, settings, on_progress)
    on_progress(f"2/5 diagnosing → {directory / DIAGNOSIS}, {VEHICLE}")
    diagnosis = diagnosed(directory, settings.seed, on_progress)
    known = learned(directory, settings, on_progress)
    on_progress(f"4/5 planning with what was found → {directory / PLANS}")
    plans = planned(directory, settings, known, on_progress)
    on_progress(f"5/5 driving uncalibrated, calibrated and corrected in turns → {directory / AFTER}")
    drive_corrected(directory, AFTER, SHOWING, settings, known, on_progress)
    return Loop(directory, settings, diagnosis, plans)


def _first_bench(directory: Path, settings: BenchSettings, on_progress: OnProgress) -> None:
    try:
        drive(directory / BEFORE, EXCITATION_RUNS, settings, {"remainders": ""}, on_progress)
    except AgvbenchError:
        # What could not begin leaves nothing behind that would have to be resumed.
        if not (directory / BEFORE / "campaign.toml").exists():
            (directory / SETTINGS).unlink(missing_ok=True)
            if not any(directory.iterdir()):
                directory.rmdir()
        raise
