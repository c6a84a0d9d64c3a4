"""Termination signals: each becomes an exception, as Ctrl-C does, so that the vehicle is stopped first."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130
"""The exit code of what Ctrl-C ended: 128 and the signal's number, as shells count."""
_ENDING = (signal.SIGTERM, signal.SIGHUP)


class Terminated(KeyboardInterrupt):
    """A signal other than Ctrl-C asked for the end: a service manager, ``kill``, a terminal that was closed."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number
        self.exit_code = 128 + number


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Return the exit code that says what ended a program.

    >>> exit_code(KeyboardInterrupt()), exit_code(Terminated(15))
    (130, 143)
    """
    return interrupt.exit_code if isinstance(interrupt, Terminated) else INTERRUPTED


@contextmanager
def interruptible() -> Iterator[None]:
    """While the context lasts, raise `Terminated` in the main thread on the first SIGTERM or SIGHUP.

    Those that follow are ignored, so that nothing comes between the vehicle and its stop. What was ignored before
    (SIGHUP under ``nohup``) stays so. Elsewhere than in the main thread this does nothing: signals cannot be taken
    there.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _ENDING}
    taken = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in taken:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number, handler in taken.items():
            signal.signal(number, handler)


def _end(number: int, _: FrameType | None) -> None:
    for ending in _ENDING:
        signal.signal(ending, signal.SIG_IGN)
    raise Terminated(number)
