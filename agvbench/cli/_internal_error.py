"""An internal error of agvbench is one line, too; its traceback, for those who fix it, is in a file."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
import traceback

from agvbench.errors import INTERNAL_ERROR_EXIT_CODE, visible

DEBUG = "AGVBENCH_DEBUG"


def report_internal_error(command: str, error: Exception) -> int:
    """Print one line about an exception that nobody expected, keep its traceback in a file, and return the exit code.

    Raises
    ------
    Exception
        The exception itself where the environment variable ``AGVBENCH_DEBUG`` is set.
    """
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:  # not ours: no file can have this name
        print(f"agvbench {command}: {error.filename}: {error.strerror}; give a shorter path", file=sys.stderr)
        return 2
    if os.environ.get(DEBUG):
        raise error
    last = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__} {error}".split())
    print(
        f"agvbench {command}: {visible(what)} at {last.filename}:{last.lineno}: a mistake of agvbench itself; "
        f"please report it with {_kept(error)}",
        file=sys.stderr,
    )
    return INTERNAL_ERROR_EXIT_CODE


def _kept(error: Exception) -> str:
    lines = traceback.format_exception(error)
    try:
        handle, path = tempfile.mkstemp(prefix="agvbench-", suffix=".traceback.txt")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.writelines(lines)
    except OSError:
        return f"its traceback ({DEBUG}=1 shows it)"
    return path
