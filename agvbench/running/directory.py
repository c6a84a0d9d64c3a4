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
    sessions = sorted(CAMPAIGNS.glob(f"*/{SETTINGS_FILE}"), key=lambda path: path.stat().st_mtime)
    if not sessions:
        raise FlagError(
            "no session to resume", where="--resume", value=f"none in {CAMPAIGNS}/", remedy="name it with --out DIR"
        )
    return sessions[-1].parent
