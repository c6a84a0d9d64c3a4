"""Clocks and watchdogs: whatever waits or times out is given a clock, so that waiting can be simulated."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Gives the time in seconds since some fixed moment, and waits in it."""

    def now(self) -> float:
        """Return the time [s]; it never goes back."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Wait for `duration_s` [s]; at once if that is not positive."""
        ...

    def wait(self, event: threading.Event, limit_s: float) -> bool:
        """Wait until `event` is set, but no longer than `limit_s` [s]; return whether it is."""
        ...


def wait_until(clock: Clock, deadline_s: float) -> float:
    """Wait until `clock` shows `deadline_s` [s]; return by how much [s] the deadline is past.

    >>> wait_until(SimulatedClock(2.0), 5.0)
    0.0
    """
    while (left_s := deadline_s - clock.now()) > 0.0:
        clock.sleep(left_s)
    return 0.0 - left_s


class WallClock:
    """Real time, of the machine's monotonic clock: all processes of one machine share it."""

    # No method around it: it is called with every message.
    now = staticmethod(time.monotonic)

    def sleep(self, duration_s: float) -> None:
        """Wait for `duration_s` [s]."""
        if duration_s > 0.0:
            time.sleep(duration_s)

    def wait(self, event: threading.Event, limit_s: float) -> bool:
        """Wait until `event` is set, but no longer than `limit_s` [s]; return whether it is."""
        return event.wait(max(0.0, limit_s))


class SimulatedClock:
    """A clock that only moves when it is waited for: waiting takes no time.

    >>> clock = SimulatedClock()
    >>> clock.sleep(3600.0)
    >>> clock.now()
    3600.0
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now(self) -> float:
        """Return the simulated time [s]."""
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Let `duration_s` [s] pass."""
        if duration_s > 0.0:
            self._now_s += duration_s

    def wait(self, event: threading.Event, limit_s: float) -> bool:
        """Let `limit_s` [s] pass unless `event` is set already; return whether it is."""
        if not event.is_set():
            self.sleep(limit_s)
        return event.is_set()


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
