"""In which order runs are driven.

Blocked order, as in the thesis' fig. 2.1, confounds the condition with battery and warm-up; interleaved order
drives every cell once before any cell twice, so that what drifts falls on all conditions alike.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def ordered(
    items: Sequence[T],
    order: str,
    *,
    seed: int,
    phase: Callable[[T], int],
    repeat: Callable[[T], int],
    name: Callable[[T], str],
) -> list[T]:
    """Return `items` in the order ``"interleaved"``, ``"blocked"`` or ``"shuffled"``, phase by phase.

    Examples
    --------
    >>> cells = [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    >>> def drive_in(order):
    ...     return ordered(cells, order, seed=1, phase=lambda c: 0, repeat=lambda c: c[1], name=str)
    >>> drive_in("interleaved")
    [('a', 1), ('b', 1), ('a', 2), ('b', 2)]
    >>> drive_in("blocked") == cells
    True
    """
    if order == "interleaved":
        return sorted(items, key=lambda item: (phase(item), repeat(item)))
    if order == "shuffled":
        return sorted(items, key=lambda item: (phase(item), _digest(seed, name(item))))
    return sorted(items, key=phase)


def _digest(seed: int, name: str) -> bytes:
    """Return a place in the shuffle that hangs on the item's own name, not on what else is driven."""
    return hashlib.sha256(f"{seed}:{name}".encode()).digest()
