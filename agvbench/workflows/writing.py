"""Files that a user asked for by an option: written, or one line that says which option to give another place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from agvbench.errors import FileError


def write_file(flag: str, path: Path, write: Callable[[Path], object]) -> None:
    """Have `write` write to `path`, whose folders are made; `flag` is the option that named it.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path)
    except OSError as error:
        remedy = f"give {flag} a place you may write to"
        raise FileError("cannot be written", where=path, value=error.strerror, remedy=remedy) from None
