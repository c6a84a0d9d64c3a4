"""Sequence numbers: what is lost on the way is counted, never silent."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from itertools import count


class Sequence:
    """Numbers what one sender publishes on one key: 1, 2, 3, …; `source` tells this life of the sender from others."""

    def __init__(self) -> None:
        self.source = secrets.randbits(32)
        # No method around it: it is called with every message.
        self.take = count(1).__next__


@dataclass(slots=True)
class LossCounter:
    """Counts what a receiver missed of one sender.

    A new source (the sender was started again) begins anew. What came before the first message cannot be known
    to be lost.

    >>> counter = LossCounter()
    >>> [counter.saw(7, number) for number in (1, 2, 5, 5, 4)]
    [0, 0, 2, 0, 0]
    >>> counter.lost, counter.repeated, counter.received
    (2, 2, 5)
    """

    received: int = 0
    lost: int = 0
    repeated: int = 0
    restarts: int = 0
    _source: int | None = None
    _last: int = 0

    def saw(self, source: int, sequence: int) -> int:
        """Note a message; return how many before it are missing."""
        self.received += 1
        if source == self._source and sequence == self._last + 1:
            self._last = sequence
            return 0
        return self._saw_other(source, sequence)

    def _saw_other(self, source: int, sequence: int) -> int:
        """Note a message that is not the next."""
        if source != self._source:
            self.restarts += self._source is not None
            self._source, self._last = source, sequence
            return 0
        missing = sequence - self._last - 1
        if missing < 0:
            self.repeated += 1
            return 0
        self._last = sequence
        self.lost += missing
        return missing
