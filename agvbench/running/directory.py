"""Which directory a bench session writes to."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from agvbench.errors import FlagError
from agvbench.running.settings import SETTINGS_FILE

CAMPAIGNS = Path("campaigns")


def choose_directory(out: str | None, *, resume: bool) -> Path:
    """Return the campaign directory: `out`, else with `resume` the newest session, else a new one.

    Raises
    ------
    FlagError
        If there is no session to resume.
    """
    if out is not None:
        return Path(out)
    if not resume:
        return CAMPAIGNS / datetime.now().astimezone().strftime("bench-%Y%m%d-%H%M%S")
    return newest(SETTINGS_FILE, "session")


def newest(file: str, what: str) -> Path:
    """Return the directory below ``campaigns`` in which the newest `file` of this name lies; `what` it makes of it.

    Raises
    ------
    FlagError
        If there is none.
    """
    found = sorted(CAMPAIGNS.glob(f"*/{file}"), key=lambda path: path.stat().st_mtime)
    if not found:
        value = f"none in {CAMPAIGNS}/"
        raise FlagError(f"no {what} to resume", where="--resume", value=value, remedy="name it with --out DIR")
    return found[-1].parent
