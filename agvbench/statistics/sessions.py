"""What an interval means when runs come in sessions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from agvbench.statistics.cells import Cell, Side
from agvbench.statistics.quantities import QUANTITIES, Quantity
from agvbench.types import Floats

_WITHIN = "the intervals cover the scatter between runs of a session, not what changes from one session to the next"
_CAUSES = "re-mounted markers, battery, floor, a new calibration of the cameras"


def session_note(cells: Sequence[Cell], *, same_campaign: bool) -> str:
    """Return, in plain words, what the intervals of a comparison of these cells cover and what they do not."""
    if same_campaign:
        return f"Both sides were driven in the same campaign: {_WITHIN}."
    scatter = [between_sessions_sd(cells, quantity) for quantity in QUANTITIES]
    if all(map(math.isnan, scatter)):
        return (
            f"Each side is one session: {_WITHIN}. Whatever else changed between the two ({_CAUSES}) is part of the "
            "difference; only more sessions of each could tell it apart."
        )
    said = ", ".join(f"{sd:.{q.digits}f} {q.unit} ({q.name})" for sd, q in zip(scatter, QUANTITIES, strict=True))
    return (
        f"Medians of sessions of one and the same side have a standard deviation of {said}: a difference "
        f"of that size between the sides may be a session's ({_CAUSES}), because {_WITHIN}."
    )


def between_sessions_sd(cells: Sequence[Cell], quantity: Quantity) -> float:
    """Return the standard deviation of session medians of the absolute error within one side; NaN with one session."""
    squares, freedom = 0.0, 0
    for cell in cells:
        for side in (cell.a, cell.b):
            if len(side.sessions) == 1:
                continue
            medians = _session_medians(side, quantity)
            squares += float(np.sum((medians - medians.mean()) ** 2))
            freedom += len(medians) - 1
    return math.sqrt(squares / freedom) if freedom else math.nan


def _session_medians(side: Side, quantity: Quantity) -> Floats:
    return np.array([float(np.median(side.values(quantity, session))) for session in side.sessions])
