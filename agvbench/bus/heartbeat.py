"""Does an adapter still answer? A process that was suspended, or a machine that hangs, keeps its token on the bus."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from agvbench.bus.clock import Clock
from agvbench.bus.questions import ask
from agvbench.errors import AdapterGoneError, AgvbenchError

PERIOD_S = 0.5
ANSWER_LIMIT_S = 1.0


class Heartbeat:
    """Asks the question `key` again and again, in a thread; calls `on_silent` when nobody answers.

    A vehicle has stopped itself by then: this is for the runner, which would else drive on without one.
    """

    def __init__(self, session: Any, key: str, clock: Clock, on_silent: Callable[[AgvbenchError], None]) -> None:
        self._session, self._key, self._clock, self._on_silent = session, key, clock, on_silent
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="agvbench-heartbeat", daemon=True)
        self._thread.start()

    def _beat(self) -> None:
        while not self._clock.wait(self._closed, PERIOD_S):
            try:
                ask(self._session, self._key, b"", ANSWER_LIMIT_S)
            except AgvbenchError:
                if not self._closed.is_set():
                    self._on_silent(self._silence())

    def _silence(self) -> AdapterGoneError:
        return AdapterGoneError(
            "adapter does not answer any more", where=self._key.rpartition("/")[0],
            value=f"waited {ANSWER_LIMIT_S:g} s",
            remedy="see whether its process hangs or was suspended, then go on with --resume",
        )  # fmt: skip

    def close(self) -> None:
        """Ask no more."""
        self._closed.set()
        self._thread.join(timeout=2.0 * ANSWER_LIMIT_S)
