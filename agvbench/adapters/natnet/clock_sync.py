"""Server ticks to host time, with an uncertainty that holds.

An echo says what the server's clock showed at some moment between sending and receiving: the host's time then is the
middle, ± half of the round trip, whatever the network did. Clocks drift apart, so an echo's bound grows with its age by
at most `MAX_DRIFT`. The estimate is the one whose bound is smallest now (Cristian's algorithm with a drift term).

References
----------
F. Cristian, Probabilistic clock synchronization, Distributed Computing 3, 1989.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

MAX_DRIFT = 100e-6
"""By how much [s/s] two quartz clocks may drift apart: two of ± 50 parts in a million."""
_KEPT = 64


class Stamp(NamedTuple):
    """A moment in host time [s], known to within ± ``uncertainty_s``."""

    time_s: float
    uncertainty_s: float


class _Echo(NamedTuple):
    host_s: float
    server_s: float
    half_s: float


class ClockSync:
    """Brings a server's time into the host's.

    >>> sync = ClockSync()
    >>> sync.echoed(sent_s=10.0, received_s=10.002, server_s=500.0)
    >>> stamp = sync.host_time(500.5)
    >>> round(stamp.time_s, 6), round(stamp.uncertainty_s, 6)
    (10.501, 0.00105)
    """

    def __init__(self) -> None:
        self._echoes: deque[_Echo] = deque(maxlen=_KEPT)
        self._best: _Echo | None = None

    def echoed(self, sent_s: float, received_s: float, server_s: float) -> None:
        """Note an echo: host times [s] of asking and hearing, and the server's time [s] in the answer."""
        echo = _Echo((sent_s + received_s) / 2.0, server_s, max(0.0, received_s - sent_s) / 2.0)
        self._echoes.append(echo)
        self._best = min(self._echoes, key=lambda one: one.half_s + MAX_DRIFT * (received_s - one.host_s))

    @property
    def ready(self) -> bool:
        """Whether there was an echo."""
        return self._best is not None

    def host_time(self, server_s: float) -> Stamp:
        """Return when in host time the server's clock showed `server_s` [s].

        Raises
        ------
        ValueError
            If there was no echo yet.
        """
        if self._best is None:
            raise ValueError("no echo yet")
        since_s = server_s - self._best.server_s
        return Stamp(self._best.host_s + since_s, self._best.half_s + MAX_DRIFT * abs(since_s))
