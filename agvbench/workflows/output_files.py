"""Output files that an option asked for: written, or one line that says which option gives another place."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from agvbench.campaign.atomic_files import replace_whole
from agvbench.campaign.manifest import list_file
from agvbench.errors import FileError


def write_file(flag: str, path: Path, write: Callable[[Path], object]) -> None:
    """Have `write` write to `path`, whose folders are made; `flag` is the option that named it.

    A file that is there is replaced by a whole one or stays as it is. Pipes and devices are written to directly.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    remedy = f"give {flag} a place you may write to"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not path.is_file():
            write(path)
        else:
            replace_whole(path.resolve(), partial(_write_listed, path.resolve(), write))
    except OSError as error:
        raise FileError("cannot be written", where=path, value=error.strerror, remedy=remedy) from None
    except FileError as error:
        raise FileError(error.what, where=path, value=error.value, remedy=error.remedy or remedy) from None


def _write_listed(path: Path, write: Callable[[Path], object], temporary: Path) -> None:
    """Have `write` write `temporary`; its hash is listed where it is to replace a file of a campaign."""
    write(temporary)
    list_file(path.parent, path.name, temporary)
