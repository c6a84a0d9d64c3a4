"""Sessions: runs between which nothing was re-mounted, re-charged or re-calibrated."""

from __future__ import annotations

import math
from collections.abc import Iterable

from agvbench.types import Run


def session_starts(runs: Iterable[Run]) -> dict[str | None, float]:
    """Return when each session's first run started [s since the campaign began], by name.

    >>> session_starts([])
    {}
    """
    began: dict[str | None, float] = {}
    for run in runs:
        began[run.session] = min(run.started_s, began.get(run.session, math.inf))
    return began
