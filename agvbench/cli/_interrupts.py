"""Ctrl-C, whatever becomes of its exception: compilers and extension modules turn it into errors of their own."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Self

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
