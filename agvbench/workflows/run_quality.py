"""How well every run was seen: tracked share, lost frames, the longest gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from agvbench.types import Frames, Run

if TYPE_CHECKING:
    import pandas as pd


def run_quality(runs: Sequence[Run], *, rate_hz: float) -> pd.DataFrame:
    """Return one row per run: what it is, its status, and how many frames were tracked, doubled and lost.

    Columns ``run_id``, ``experiment``, ``trajectory``, ``condition``, ``status``, ``frames`` (that arrived),
    ``expected`` (between the first and the last capture time at `rate_hz`), ``tracked`` (distinct capture times
    with a pose), ``doubled``, ``lost_share`` (the share of expected frames that brought no pose) and ``longest_gap_s``
    (NaN below two tracked frames).
    """
    import pandas as pd

    columns = ("run_id", "experiment", "trajectory", "condition", "status")
    rows = [{c: getattr(run, c) for c in columns} | _seen(run.frames, rate_hz) for run in runs]
    return pd.DataFrame(rows)


def _seen(frames: Frames, rate_hz: float) -> dict[str, float]:
    times = np.unique(frames.t_s[np.isfinite(frames.t_s)])
    tracked = np.unique(frames.t_s[frames.tracked.astype(np.bool_)])
    expected = round(float(times[-1] - times[0]) * rate_hz) + 1 if len(times) else 0
    return {
        "frames": len(frames),
        "expected": expected,
        "tracked": len(tracked),
        "doubled": len(frames) - len(times),
        "lost_share": max(0.0, 1.0 - len(tracked) / expected) if expected else float("nan"),
        "longest_gap_s": float(np.max(np.diff(tracked))) if len(tracked) > 1 else float("nan"),
    }
