"""An internal error of agvbench is one line, too; its traceback, for developers, is in a file."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Self

from agvbench.errors import INTERNAL_ERROR_EXIT_CODE, visible

DEBUG = "AGVBENCH_DEBUG"


def report_internal_error(command: str, error: Exception) -> int:
    """Print one line about an unexpected exception, keep its traceback in a file, and return the exit code.

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
    import traceback

    last = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__} {error}".split())
    print(
        f"agvbench {command}: {visible(what)} at {last.filename}:{last.lineno}: a mistake of agvbench itself; "
        f"please report it with {_kept(error)}",
        file=sys.stderr,
    )
    return INTERNAL_ERROR_EXIT_CODE


def _kept(error: Exception) -> str:
    import tempfile
    import traceback

    lines = traceback.format_exception(error)
    try:
        handle, path = tempfile.mkstemp(prefix="agvbench-", suffix=".traceback.txt")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.writelines(lines)
    except OSError:
        return f"its traceback ({DEBUG}=1 shows it)"
    return path


EXIT_CODE = 130
"""What Ctrl-C ended: 128 and the signal's number, as shells count."""


class Interrupts:
    """While the context lasts, remembers whether Ctrl-C was pressed; `KeyboardInterrupt` is raised as ever.

    Elsewhere than in the main thread, and where SIGINT is not Python's own, nothing is changed.
    """

    def __init__(self) -> None:
        self.pressed = False
        self._taken = False

    def __enter__(self) -> Self:
        in_main = threading.current_thread() is threading.main_thread()
        if in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._press)
            self._taken = True
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._taken:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _press(self, number: int, frame: FrameType | None) -> None:
        self.pressed = True
        signal.default_int_handler(number, frame)
