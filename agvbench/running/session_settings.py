"""What a session is asked for: the command line, a vehicle beside it, and what an interrupted session began with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agvbench.running.directory import choose_directory
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
    """
    directory = choose_directory(out, resume=resume)
    if resume and (directory / SETTINGS_FILE).exists():
        return directory, settings_for_resume(BenchSettings.load(directory), given)
    return directory, BenchSettings.given({"vehicle": lab_vehicle(), **given})
