"""A limit on the memory and the temporary files that reading a bag takes: a few kB may decompress into TB."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MAX_BYTES = 4 << 30
MAX_TEMPORARY_BYTES = 64 << 30


@contextmanager
def limited_memory() -> Iterator[None]:
    """Let this process take at most `MAX_BYTES` more while the context lasts, and write files to a limit.

    The libraries that read bags decompress whatever the file says; beyond the limit they raise `MemoryError`.
    """
    limits = {kind: resource.getrlimit(kind) for kind in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)}
    for (kind, (soft, hard)), wanted in zip(limits.items(), (_taken() + MAX_BYTES, MAX_TEMPORARY_BYTES), strict=True):
        lower = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
        resource.setrlimit(kind, (min([wanted, *lower]), hard))
    try:
        yield
    finally:
        for kind, limit in limits.items():
            resource.setrlimit(kind, limit)


def _taken() -> int:
    """Return the bytes that count against the limit now: the sixth number of ``statm``, in pages (proc(5))."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * resource.getpagesize()
