"""One session at a time writes to a campaign directory."""

from __future__ import annotations

import fcntl
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agvbench.errors import CampaignError

LOCK_FILE = ".lock"


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the lock of `directory`, which is made if absent; the kernel releases it when this process ends.

    File systems without locks are used without one.

    Raises
    ------
    CampaignError
        If another process holds it, or the directory cannot be written.
    """
    descriptor = _opened(directory)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CampaignError(
                "another session is recording to it", where=directory, value=_holder(descriptor),
                remedy="wait until it ends, or choose another directory with --out",
            ) from None  # fmt: skip
        except OSError:
            pass
        else:
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"process {os.getpid()} on {platform.node()}\n".encode(), 0)
        yield
    finally:
        os.close(descriptor)


def _opened(directory: Path) -> int:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return os.open(directory / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CampaignError(
            f"cannot be written ({error.strerror})", where=directory, remedy="choose another directory"
        ) from None


def _holder(descriptor: int) -> str:
    return os.pread(descriptor, 200, 0).decode(errors="replace").strip()
