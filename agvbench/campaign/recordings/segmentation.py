"""Segment a recording into runs, and count each of its rows as used or say why it is not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.manifest import sha256_of_all
from agvbench.campaign.recordings.mapping import Runs
from agvbench.campaign.recordings.recording import Recording
from agvbench.types import Floats


def cut(recording: Recording, rules: Runs) -> list[slice]:
    """Return the rows of each run; every run begins and ends with a usable pose.

    A cut falls where the vehicle is not driven, the cut column changes, or no usable pose comes for more than
    ``gap_s``. Pieces shorter than ``shortest_s`` are left out; those longer than ``longest_s`` are divided evenly.
    """
    rows = np.flatnonzero(recording.usable)
    if not len(rows):
        return []
    t_s = recording.t_s[rows]
    idle = np.cumsum(~recording.driven)[rows]
    apart = (np.diff(t_s) > rules.gap_s) | (np.diff(idle) > 0) | (np.diff(recording.cut[rows]) != 0)
    pieces = np.split(rows, np.flatnonzero(apart) + 1)
    return [
        slice(int(part[0]), int(part[-1]) + 1)
        for piece in pieces
        if _duration(recording.t_s, piece) >= rules.shortest_s
        for part in _divide(recording.t_s, piece, rules.longest_s)
        if len(part) > 1
    ]


def _duration(t_s: Floats, rows: NDArray[np.int64]) -> float:
    return float(t_s[rows[-1]] - t_s[rows[0]])


def _divide(t_s: Floats, rows: NDArray[np.int64], longest_s: float | None) -> Iterator[NDArray[np.int64]]:
    count = 1 if longest_s is None else min(math.ceil(_duration(t_s, rows) / longest_s), len(rows))
    edges = np.linspace(t_s[rows[0]], t_s[rows[-1]], count + 1)[1:-1]
    yield from np.split(rows, np.searchsorted(t_s[rows], edges))


Account = dict[str, Any]


def account_for(recording: Recording, pieces: list[slice]) -> Account:
    """Count each row once: used, or why not."""
    used = np.zeros(len(recording), np.bool_)
    for rows in pieces:
        used[rows] = recording.usable[rows]
    driven, seen = recording.driven, recording.seen
    return {
        "file": recording.path.name,
        "rows": len(recording),
        "not_driven": int(np.count_nonzero(~driven)),
        "not_seen": int(np.count_nonzero(driven & ~seen)),
        "jumped": int(np.count_nonzero(driven & recording.jumped)),
        "too_short": int(np.count_nonzero(recording.usable & ~used)),
        "used": int(np.count_nonzero(used)),
        "runs": len(pieces),
        "seconds": round(sum(float(recording.t_s[rows.stop - 1] - recording.t_s[rows.start]) for rows in pieces), 2),
        "sha256": sha256_of_all(recording.files),
    }


def why_nothing(accounts: list[Account]) -> str:
    """Say where all rows have gone when no run is left."""
    reasons = ("not_driven", "not_seen", "jumped", "too_short")
    totals = {reason: sum(account[reason] for account in accounts) for reason in reasons}
    counted = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in totals.items())
    return f"no run is left of {sum(account['rows'] for account in accounts)} rows ({counted})"
