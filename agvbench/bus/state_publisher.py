"""Publication of a runner's state: a thread of its own samples it, so that no control cycle ever waits for the bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from agvbench.bus.counters import Sequence
from agvbench.bus.keys import Keys
from agvbench.bus.messages.codec import ENCODING, encode
from agvbench.bus.messages.runner_state import RunnerState

REAL_TIME_PERIOD_S, LOCK_STEP_PERIOD_S = 0.1, 0.25
"""A simulation has no operator beside it, and every message takes computing time from it."""
StateSource = Callable[[int, int], RunnerState]
"""Returns the state now, given the number and the source of its message."""


class StatePublisher:
    """Publishes a runner's state while there are subscribers, and answers queries, until `close`.

    Subscribers get at most one message per `period_s` [s]. A late one queries the last state, of which at most one is
    made per period, too. Without subscriber and query no state is made at all.
    """

    def __init__(self, session: Any, keys: Keys, source: int, state: StateSource, *, period_s: float) -> None:
        import zenoh

        self._keys, self._source, self._state, self._period_s = keys, source, state, period_s
        self._take, self._error = Sequence().take, zenoh.ZError
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._payload, self._made_s = b"", -period_s
        # DROP: only the last state counts, so a lost one is replaced by the next. With BLOCK, a subscriber that takes
        # nothing (a suspended terminal, a slow radio link) would fill the session's queue, which commands share.
        # DATA_LOW: whatever waits, commands (REAL_TIME) and frames go first.
        self._publisher = session.declare_publisher(
            keys.state,
            encoding=ENCODING,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
        )
        self._queryable = session.declare_queryable(keys.state, self._answer)
        self._thread = threading.Thread(target=self._sample, name="agvbench-runner-state", daemon=True)
        self._thread.start()

    def _sample(self) -> None:
        while not self._ended.wait(self._period_s):
            try:
                if self._publisher.matching_status.matching:
                    self._publisher.put(self._current())
            except (self._error, RuntimeError):  # the session was closed
                return

    def _current(self, *, anew: bool = False) -> bytes:
        """Return the state's bytes, made within the last period; `anew` made now."""
        with self._lock:
            now_s = time.monotonic()
            # A little less than a period, or every other sample would be the one before.
            if anew or now_s - self._made_s > 0.9 * self._period_s:
                self._payload, self._made_s = encode(self._state(self._take(), self._source)), now_s
            return self._payload

    def _answer(self, query: Any) -> None:
        """Answer a query, in a thread of Zenoh."""
        with query, suppress(self._error, RuntimeError):
            query.reply(self._keys.state, self._current(), encoding=ENCODING)

    def close(self) -> None:
        """Publish the last state, and no more."""
        self._ended.set()
        self._thread.join(timeout=2.0)
        with suppress(self._error, RuntimeError):
            self._publisher.put(self._current(anew=True))
        self._queryable.undeclare()
        with suppress(RuntimeError):  # a put that waits has it; it goes with the session
            self._publisher.undeclare()
