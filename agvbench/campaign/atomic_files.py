"""Atomic writes: a file is whole or absent (written beside the target, synced to disk, renamed into place)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

TEMPORARY_PREFIX = ".tmp-"


def write_atomically(path: Path, data: bytes | memoryview, *, durable: bool = True) -> None:
    """Write `data` to `path` so that a reader sees the old file or the new one and never a part of it.

    With `durable` the data are on the disk before the name is, and the name before this returns, so that it also
    holds through a power cut.
    """
    temporary = path.with_name(TEMPORARY_PREFIX + path.name)
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    try:
        write_all(descriptor, data, durable=durable)
    finally:
        os.close(descriptor)
    temporary.replace(path)
    if durable:
        _force_to_disk(path.parent)


def write_all(descriptor: int, data: bytes | memoryview, *, durable: bool) -> None:
    """Write `data` to its end to an open file; with `durable` they are on the disk before this returns."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]
    if durable:
        os.fsync(descriptor)


def replace_whole(path: Path, write: Callable[[Path], object], *, durable: bool = True) -> None:
    """Have `write` write a file beside `path`, and put it in its place once it is whole and, if `durable`, on disk."""
    temporary = path.with_name(TEMPORARY_PREFIX + path.name)
    try:
        write(temporary)
        if durable:
            _force_to_disk(temporary)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    temporary.replace(path)
    if durable:
        _force_to_disk(path.parent)


@contextmanager
def made_folder(path: Path) -> Iterator[None]:
    """Make the folder `path` and those above it; if the context fails, those that are new and empty are removed."""
    new = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        with suppress(OSError):
            for folder in new:
                folder.rmdir()
        raise


def _force_to_disk(path: Path) -> None:
    """Let a file's content, or the names in a directory, outlive a power cut."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def is_temporary(path: Path) -> bool:
    """Whether `path` is what an interrupted `write_atomically` left."""
    return path.name.startswith(TEMPORARY_PREFIX)
