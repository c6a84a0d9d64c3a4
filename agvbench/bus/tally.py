"""Counting what may come by the thousand, and saying so seldom."""

from __future__ import annotations


class Tally:
    """Counts, and says when it is time to tell: at the `first`, and whenever there are ten times as many.

    However fast something comes, telling of it takes next to nothing, and the last number told is never off by more
    than a factor of ten.

    >>> tally = Tally()
    >>> [number for number in range(1, 1001) if tally.add()]
    [1, 10, 100, 1000]
    """

    __slots__ = ("_next", "count")

    def __init__(self, first: int = 1) -> None:
        self.count, self._next = 0, first

    def add(self, more: int = 1) -> bool:
        """Count; return whether to tell."""
        self.count += more
        if self.count < self._next:
            return False
        while self._next <= self.count:
            self._next *= 10
        return True

    def __str__(self) -> str:
        return f"{self.count} so far" if self.count > 1 else "the first"
