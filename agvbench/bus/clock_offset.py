"""The offset between two machines' clocks, by the round trip that took least time (Cristian's algorithm)."""

from __future__ import annotations

from typing import Any

from agvbench.bus.clock import Clock
from agvbench.bus.questions import ask
from agvbench.bus.request_message import decode_time

_ROUND_TRIPS = 8
_LIMIT_S = 2.0


def measure_offset(session: Any, key: str, clock: Clock, round_trips: int = _ROUND_TRIPS) -> float:
    """Return what to add [s] to the clock behind `key` to get the time of `clock`.

    The error is at most half of the shortest round trip; the shortest is used, since delays only ever add.

    Raises
    ------
    AdapterGoneError
        If the adapter behind `key` does not answer.

    References
    ----------
    F. Cristian, Probabilistic clock synchronization, Distributed Computing 3, 1989.
    """
    best_s, offset_s = float("inf"), 0.0
    for _ in range(round_trips):
        sent_s = clock.now()
        there_s = decode_time(ask(session, key, b"", _LIMIT_S))
        trip_s = clock.now() - sent_s
        if trip_s < best_s:
            best_s, offset_s = trip_s, sent_s + trip_s / 2.0 - there_s
    return offset_s
