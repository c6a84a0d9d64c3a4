"""Command histories of residual rates whose drive and axles were never commanded otherwise."""

from __future__ import annotations

import numpy as np

from agvbench.diagnosis.discrepancy.command_history import (
    DEAD_BANDS,
    LOADS_S,
    REACHES_RAD,
    RECOVERIES_S,
    SLIPS_BEYOND,
    CommandHistory,
)


def history_of(tangent: np.ndarray, previous: np.ndarray, levels: np.ndarray | None = None) -> CommandHistory:
    """Return the history of axles with these tangents (n, 2) now and before, without any other memory."""
    n = len(tangent)
    return CommandHistory(
        tangent,
        previous,
        reversal=tangent,
        levels=np.zeros((n, 3), dtype=np.int64) if levels is None else levels,
        lags=np.zeros((n, 2, len(REACHES_RAD))),
        loads=np.zeros((n, len(RECOVERIES_S))),
        creeps=np.zeros((n, 2, len(RECOVERIES_S))),
        kept=np.zeros((n, 2, len(DEAD_BANDS))),
        above=np.full((n, 2, len(SLIPS_BEYOND)), -1.0),
        below=np.full((n, 2, len(SLIPS_BEYOND)), -1.0),
        reach=500.0,
        drive_load=np.zeros((n, len(LOADS_S))),
        reversed_s=np.full(n, np.inf),
    )
