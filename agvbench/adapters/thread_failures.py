"""Exceptions that end a thread of an adapter: without a report, frames or answers would just cease.

Python calls `threading.excepthook` for them. While an adapter is watched, an exception that passed through its file, or
through a file beside it, is reported as a `LinkError` with the line; every other one goes where it went before.
"""

from __future__ import annotations

import inspect
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from agvbench.adapters.contract import AgvAdapter, MocapAdapter
from agvbench.errors import AgvbenchError, LinkError

_PACKAGES = "agvbench.adapters.natnet."
"""Whose threads are those of the shipped adapters, which lie in another folder."""

Report = Callable[[Exception], None]


class _Entry(NamedTuple):
    folders: frozenset[Path]
    report: Report


class _Hook:
    """The hook of this process, in place while at least one adapter is watched."""

    def __init__(self) -> None:
        self._watched: list[_Entry] = []
        self._before = threading.excepthook
        self._lock = threading.Lock()

    def add(self, entry: _Entry) -> None:
        """Report exceptions of these folders from now on."""
        with self._lock:
            if not self._watched:
                self._before, threading.excepthook = threading.excepthook, self
            self._watched.append(entry)

    def remove(self, entry: _Entry) -> None:
        """Report them no more."""
        with self._lock:
            self._watched.remove(entry)
            if not self._watched:
                threading.excepthook = self._before

    def __call__(self, caught: threading.ExceptHookArgs) -> None:
        """Report the exception that ended a thread, or pass it on."""
        error, reported = caught.exc_value, False
        for folders, report in tuple(self._watched):
            own = [frame for frame in traceback.extract_tb(caught.exc_traceback) if _folder(frame.filename) in folders]
            if own and isinstance(error, Exception):
                report(_thread_error(error, caught.thread, own[-1]))
                reported = True
        if not reported:
            self._before(caught)


_HOOK = _Hook()


@contextmanager
def report_thread_failures(adapter: object, report: Report) -> Iterator[None]:
    """While the context lasts, call `report` with an error if an exception ends a thread that runs the adapter's code.

    `report` is called in that thread.
    """
    entry = _Entry(frozenset(_folders(adapter)), report)
    _HOOK.add(entry)
    try:
        yield
    finally:
        _HOOK.remove(entry)


def _folders(adapter: object) -> Iterator[Path]:
    """Give the folders of the files that define the adapter's class, and what it holds of adapters and their packages.

    The contract itself, which all of them derive from, does not count.
    """
    for cls in type(adapter).__mro__:
        if issubclass(cls, (AgvAdapter, MocapAdapter)) and cls not in (AgvAdapter, MocapAdapter):
            yield _folder(inspect.getfile(cls))
    for held in vars(adapter).values():
        if isinstance(held, (AgvAdapter, MocapAdapter)):
            yield from _folders(held)
        elif type(held).__module__.startswith(_PACKAGES):
            yield _folder(inspect.getfile(type(held)))


def _folder(file: str) -> Path:
    return Path(file).absolute().parent


def _thread_error(error: Exception, thread: threading.Thread | None, at: traceback.FrameSummary) -> AgvbenchError:
    if isinstance(error, AgvbenchError):
        return error
    return LinkError(
        "an exception ended a thread of the adapter", where=thread.name if thread else None,
        value=" ".join(f"{type(error).__name__}: {error}".split()),
        remedy=f"catch it and call reports.failed; look at {Path(at.filename).name}, line {at.lineno}",
    )  # fmt: skip
