"""What a session is asked for: the command line, a vehicle beside it, and what an interrupted session began with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from agvbench.campaign.header import FILE_NAME
from agvbench.errors import CampaignError
from agvbench.running.calibrating import VEHICLE_FILE
from agvbench.running.directory import choose_directory, has_runs
from agvbench.running.provenance import INPUTS_TABLE, recorded_rows
from agvbench.running.settings import SETTINGS_FILE, BenchSettings, settings_for_resume
from agvbench.running.vehicles import lab_vehicle


def session_settings(given: Mapping[str, Any], out: str | None, *, resume: bool) -> tuple[Path, BenchSettings]:
    """Return where a session writes, and its settings: what was `given`, over what it began with if it is resumed.

    Raises
    ------
    FlagError
        If an option cannot be used or contradicts what the session began with, or there is none to resume.
    FileError
        If what it began with cannot be read.
    CampaignError
        If a campaign that is to be resumed lacks its header, or its runs lack the settings of their session.
    """
    directory = choose_directory(out, resume=resume)
    if resume and (directory / SETTINGS_FILE).exists():
        settings = settings_for_resume(BenchSettings.load(directory), given)
        _require(directory, FILE_NAME, "the header of the campaign")
        return directory, _with_own_calibration(directory, settings)
    if resume and has_runs(directory):  # a session that ended between header and settings has no runs
        _require(directory, SETTINGS_FILE, "the settings of its session")
    return directory, BenchSettings.given({"vehicle": lab_vehicle(), **given})


def _require(directory: Path, name: str, what: str) -> None:
    if not (directory / name).exists():
        raise CampaignError(
            f"cannot be resumed without {name} ({what})", where=directory,
            remedy="restore it from a copy, or begin a new campaign in another directory",
        )  # fmt: skip


def _with_own_calibration(directory: Path, settings: BenchSettings) -> BenchSettings:
    """Return `settings` with the campaign's copy of the calibration where the file that was given is gone."""
    copy = directory / VEHICLE_FILE
    if not settings.calibration or Path(settings.calibration).exists() or not copy.is_file():
        return settings
    is_hashed = any(row["input"] == "--calibration" for row in recorded_rows(directory, INPUTS_TABLE))
    return replace(settings, calibration=str(copy)) if is_hashed else settings
