"""A watchdog for waits that have no time limit of their own."""

from __future__ import annotations

import threading
from collections.abc import Callable

from agvbench.bus.clock import Clock


class Watchdog:
    """Calls `bark` when it stays armed for longer than its limit.

    Arming costs two assignments and no thread switch: a thread looks every `period_s` [s] of `clock`.
    """

    def __init__(self, clock: Clock, limit_s: float, bark: Callable[[], None], period_s: float = 0.2) -> None:
        self.limit_s = limit_s
        self._clock, self._bark, self._period_s = clock, bark, period_s
        self._armed_s: float | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="agvbench-watchdog", daemon=True)
        self._thread.start()

    def arm(self) -> None:
        """Begin to count."""
        self._armed_s = self._clock.now()

    def disarm(self) -> None:
        """Stop counting."""
        self._armed_s = None

    @property
    def waited_s(self) -> float:
        """For how long [s] it has been armed."""
        armed_s = self._armed_s
        return 0.0 if armed_s is None else self._clock.now() - armed_s

    @property
    def expired(self) -> bool:
        """Whether it has been armed for longer than its limit."""
        return self.waited_s > self.limit_s

    def _watch(self) -> None:
        while not self._clock.wait(self._closed, self._period_s):
            if self.expired:
                self._bark()

    def close(self) -> None:
        """End the thread."""
        self._armed_s = None
        self._closed.set()
        self._thread.join()
