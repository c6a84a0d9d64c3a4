"""What ``agvbench import`` does: recordings in, a campaign and an account of every row out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import track

from agvbench.campaign import Campaign, import_recordings


def run_import(mapping: str, files: Sequence[str], out: str) -> Campaign:
    """Import `files` with a progress bar; return the campaign, which has the account of every row.

    Raises
    ------
    InputError
        If the mapping, a file or the directory `out` cannot be used.
    """
    errors = Console(stderr=True)

    def progress(paths: Iterable[Path]) -> Iterable[Path]:
        return track(paths, "importing", console=errors, transient=True, disable=not errors.is_terminal)

    return import_recordings(mapping, files, out, progress=progress)
