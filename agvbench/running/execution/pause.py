"""Pause between runs, with the vehicle at neutral, and go on: by a file in the campaign directory, or Ctrl-Z.

The file is the only state: any process that can write the directory can pause, over ssh, in tmux, from a script. Ctrl-Z
writes and removes it; it does not suspend the program, which has to keep listening to vehicle and camera.
"""

from __future__ import annotations

import itertools
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from agvbench.running.links import RunnerLink
from agvbench.types import Command

PAUSE_FILE = "pause"
_STAND_S = 0.25


def holding_neutral(link: RunnerLink, neutral: Command) -> Callable[[], None]:
    """Return what lets a vehicle stand at `neutral` for a moment, everybody being heard; simulated time stops."""
    waited_s = itertools.count(0.0, _STAND_S)

    def stand() -> None:
        if link.identity().lock_step:
            time.sleep(_STAND_S)
        else:
            link.control_cycle(neutral, t_s=next(waited_s), hold_s=_STAND_S)

    return stand


class PauseRequest:
    """Whether the campaign in `directory` is to pause; `on_progress` prints to the operator."""

    def __init__(self, directory: Path, on_progress: Callable[[str], None]) -> None:
        self._file, self._on_progress = directory / PAUSE_FILE, on_progress
        self._by_signal = False

    def is_requested(self) -> bool:
        """Whether a pause is requested."""
        return self._file.exists()

    def wait(self, before: str, stand: Callable[[], None]) -> None:
        """Return at once, or when a pause is no longer requested; the run `before` is next.

        `stand` lets the vehicle stand at neutral for a moment; what it raises ends the pause.
        """
        if not self.is_requested():
            return
        self._on_progress(
            f"paused before {before}, the vehicle at neutral: press Ctrl-Z or remove {self._file} to go on"
        )
        while self.is_requested():
            stand()
        self._by_signal = False
        self._on_progress("going on")

    @contextmanager
    def by_signal(self) -> Iterator[None]:
        """While the context lasts, SIGTSTP (Ctrl-Z) asks for a pause and, a second time, to go on.

        So does SIGCONT: a shell that suspended the program around this one (nox) sends it with ``fg``. It ends only a
        pause that SIGTSTP began. Elsewhere than in the main thread, and where SIGTSTP is ignored, nothing is changed.
        """
        in_main = threading.current_thread() is threading.main_thread()
        if not in_main or signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN:
            yield
            return
        before = {number: signal.getsignal(number) for number in (signal.SIGTSTP, signal.SIGCONT)}
        for number in before:
            signal.signal(number, self._signalled)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _signalled(self, number: int, _: FrameType | None) -> None:
        # Without its directory the session ends by itself; and what is just being printed cannot be printed into.
        with suppress(OSError, RuntimeError):
            if number == signal.SIGTSTP and not self.is_requested():
                self._file.touch()
                self._by_signal = True
                self._on_progress("pausing when this run is finished; Ctrl-Z again goes on")
            elif number == signal.SIGTSTP or self._by_signal:
                self._file.unlink(missing_ok=True)
                self._by_signal = False
