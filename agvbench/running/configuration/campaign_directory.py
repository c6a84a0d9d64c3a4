"""The campaign directory of a bench session: given, new, or the newest to be resumed."""

from __future__ import annotations

import difflib
from datetime import datetime
from pathlib import Path

from agvbench.campaign.header import FILE_NAME
from agvbench.campaign.tables.source import parts
from agvbench.errors import FlagError
from agvbench.running.configuration.settings import SETTINGS_FILE

CAMPAIGNS = Path("campaigns")
_SHOWN = 3


def choose_directory(out: str | None, *, resume: bool) -> Path:
    """Return the campaign directory: `out`, else with `resume` the newest session, else a new one.

    Raises
    ------
    FlagError
        If there is no session to resume.
    """
    if out is not None:
        if resume and not has_session(Path(out)):
            raise _no_session_in(Path(out))
        return Path(out)
    if not resume:
        return CAMPAIGNS / datetime.now().astimezone().strftime("bench-%Y%m%d-%H%M%S")
    return newest(SETTINGS_FILE, "session")


def has_session(directory: Path) -> bool:
    """Return whether a session began in `directory`, even if it ended before its first run."""
    try:
        return any((directory / name).is_file() for name in (SETTINGS_FILE, FILE_NAME))
    except OSError:  # not a name that a directory can have
        return False


def has_runs(directory: Path) -> bool:
    """Return whether a run is recorded in `directory`."""
    runs = directory / "runs.parquet"
    return runs.is_dir() and bool(parts(runs))


def _no_session_in(out: Path) -> FlagError:
    """Return the error for a directory without a session, with the sessions beside it, those of similar names first."""
    sessions = {path.parent for folder in (out.parent, CAMPAIGNS) for path in folder.glob(f"*/{SETTINGS_FILE}")}
    close = difflib.get_close_matches(str(out), map(str, sessions), n=_SHOWN, cutoff=0.0)
    there = f"sessions are in {', '.join(close)}; name one" if close else "leave --resume out to begin one"
    return FlagError("no session to resume", where="--resume --out", value=out, remedy=there)


def shown(directory: Path) -> Path:
    """Return an absolute path as people write it: relative where it lies below the working directory."""
    return directory.relative_to(Path.cwd()) if directory.is_relative_to(Path.cwd()) else directory


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
