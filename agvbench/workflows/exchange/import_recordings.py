"""What ``agvbench import`` does: recordings in, a campaign and an account of every row out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import track

from agvbench.campaign import Campaign, import_recordings
from agvbench.campaign.recordings.bags.bag import is_bag
from agvbench.campaign.recordings.guess import guess_mapping
from agvbench.campaign.recordings.guess_bag import topic_lines
from agvbench.errors import FileError


def run_guess(files: Sequence[str], out: str) -> tuple[list[str], list[str]]:
    """Write the guessed mapping of one recording to the new file `out`.

    Returns
    -------
    The topics of the recording if it is a bag, and the questions that the mapping leaves, one line each.

    Raises
    ------
    FileError
        If there is more than one recording, it cannot be guessed, or `out` exists or cannot be written.
    """
    if len(files) != 1:
        remedy = "give the one that has all columns"
        raise FileError(
            "a mapping is guessed from one recording", where="--guess", value=f"{len(files)}", remedy=remedy
        )
    path = Path(out)
    if path.exists():
        raise FileError("exists already", where=path, remedy="choose another file")
    topics = topic_lines(Path(files[0])) if is_bag(Path(files[0])) else []
    text, questions = guess_mapping(files[0])
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot be written ({error.strerror})", where=path, remedy="choose another file") from None
    return topics, questions


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
