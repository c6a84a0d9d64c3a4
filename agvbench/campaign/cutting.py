"""Cut a recording into runs: where driving stops, the vehicle is lost for long, or a run grows too long."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.mapping_schema import Runs
from agvbench.campaign.recording import Recording
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
