"""Commands of driving by hand, merged where they follow each other faster than a prediction can tell.

A joystick that a logger reads fifty times a second changes in small steps, each of which costs the simulation as much
time as a large one. Successive commands are replaced by their mean. Where they differ by a share ρ of the range of a
channel and last for T together, the integral of the difference is ρ T / 4 at most: that of a step over the whole range
which comes ρ T / 4 early or late. Time stamps are not so exact.

Long before a window, only controllers with time constants of seconds still depend on a command, and on its mean rather
than its steps: there commands are merged for longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from agvbench.compiled import cached_njit
from agvbench.types import Command, Commands, Floats, Run

_SHARE_SECONDS, _LONGEST_S = 5e-4, 0.2
_LONG_BEFORE_S, _LONGER, _LOOSER = 2.0, 10.0, 100.0
"""How long before a window the duration may be longer, and the difference larger, and the factors on their limits."""


@dataclass(frozen=True)
class CommandMerging:
    """Merges successive commands that differ little for a short time; ``ranges`` (3,) are those of the channels.

    Neutral is merged with nothing else, nor are commands on either side of it.
    """

    ranges: Floats
    neutral: Command

    @classmethod
    def of(cls, runs: Sequence[Run], neutral: Command) -> Self:
        """Return the merging by the ranges of the commands of `runs`."""
        ranges = [_range([getattr(run.commands, role) for run in runs]) for role in Command._fields]
        return cls(np.array(ranges), neutral)

    def merged(self, commands: Commands, begins_s: float) -> Commands:
        """Return the commands with means in place of those that are merged, for a window that begins at `begins_s`."""
        changes = commands.without_repeats()
        if len(changes) < 2:
            return changes
        rows = np.column_stack([changes.drive, changes.front, changes.rear])
        ends_s = np.append(changes.t_s[1:], np.inf)
        sides = np.sign(rows - np.array(self.neutral))
        is_long_before = ends_s <= begins_s - _LONG_BEFORE_S
        begins = np.flatnonzero(_begins(changes.t_s, ends_s, rows / self.ranges, sides, is_long_before))
        held_s = np.where(np.isfinite(ends_s), ends_s - changes.t_s, 1.0)
        means = np.add.reduceat(rows * held_s[:, None], begins) / np.add.reduceat(held_s, begins)[:, None]
        varies = np.maximum.reduceat(rows, begins) > np.minimum.reduceat(rows, begins)
        return Commands(changes.t_s[begins], *np.where(varies, means, rows[begins]).T)


def _range(values: Sequence[Floats]) -> float:
    """Return the range of a channel; ∞ if it has one value, of which nothing is a share."""
    joined = np.concatenate([*values, np.empty(0)])
    length = float(np.ptp(joined)) if len(joined) else 0.0
    return length if length > 0.0 else np.inf


@cached_njit()
def _begins(
    t_s: Floats, ends_s: Floats, shares: Floats, sides: Floats, is_long_before: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which rows (n,) begin another merged row; `shares` (n, 3) are the commands over their ranges."""
    begins = np.ones(len(t_s), dtype=np.bool_)
    first, low, high = 0, shares[0].copy(), shares[0].copy()
    for i in range(1, len(t_s)):
        lasts_s = ends_s[i] - t_s[first]
        longest_s, share_seconds = _LONGEST_S, _SHARE_SECONDS
        if is_long_before[i]:
            longest_s, share_seconds = _LONGER * longest_s, _LOOSER * share_seconds
        fits = lasts_s <= longest_s
        for k in range(shares.shape[1]):
            most = max(high[k], shares[i, k]) - min(low[k], shares[i, k])
            fits = fits and sides[i, k] == sides[first, k] and most * lasts_s <= share_seconds
        if fits:
            begins[i] = False
            low, high = np.minimum(low, shares[i]), np.maximum(high, shares[i])
        else:
            first = i
            low[:], high[:] = shares[i], shares[i]
    return begins
