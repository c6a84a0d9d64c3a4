"""Sequence numbers, counters of lost messages, and rate-limited counters of events."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from itertools import count


class Sequence:
    """Numbers what one sender publishes on one key: 1, 2, 3, …; `source` differs after each start of the sender."""

    def __init__(self) -> None:
        self.source = secrets.randbits(32)
        # No method around it: it is called with every message.
        self.take = count(1).__next__


@dataclass(slots=True)
class LossCounter:
    """Counts the messages of one sender that a receiver lost.

    A new source (the sender was started again) begins anew. What came before the first message cannot be known
    to be lost.

    >>> counter = LossCounter()
    >>> [counter.saw(7, number) for number in (1, 2, 5, 5, 4)]
    [0, 0, 2, 0, 0]
    >>> counter.lost, counter.repeated, counter.received
    (2, 2, 5)
    """

    lost: int = 0
    repeated: int = 0
    restarts: int = 0
    source: int = -1
    """The sender that is being counted (-1: none yet)."""
    expected: int = 0
    """The number that comes next if nothing is lost."""
    _uncounted: int = 0

    @property
    def received(self) -> int:
        """How many messages were noted."""
        return self.expected - self._uncounted

    def saw(self, source: int, sequence: int) -> int:
        """Note a message; return how many before it are missing.

        Where every call counts, the message that was expected is noted without one: ``counter.expected += 1``.
        """
        missing = sequence - self.expected if source == self.source else 0
        received = self.received + 1
        if source != self.source:
            self.restarts += self.source >= 0
            self.source, self.expected = source, sequence + 1
        elif missing < 0:
            self.repeated += 1
        else:
            self.lost += missing
            self.expected = sequence + 1
        self._uncounted = self.expected - received
        return max(missing, 0)


class RateLimitedCounter:
    """Counts, and says when a report is due: at the `first`, and whenever there are ten times as many.

    However fast something comes, reports of it take next to nothing, and the last number reported is never off by more
    than a factor of ten.

    >>> counter = RateLimitedCounter()
    >>> [number for number in range(1, 1001) if counter.add()]
    [1, 10, 100, 1000]
    """

    __slots__ = ("_next", "count")

    def __init__(self, first: int = 1) -> None:
        self.count, self._next = 0, first

    def add(self, more: int = 1) -> bool:
        """Count; return whether a report is due."""
        self.count += more
        if self.count < self._next:
            return False
        while self._next <= self.count:
            self._next *= 10
        return True

    def __str__(self) -> str:
        return f"{self.count} so far" if self.count > 1 else "the first"
