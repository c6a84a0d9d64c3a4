"""Whether a campaign of runs from rest is sufficient for a diagnosis: enough runs, repeats, motion and steering."""

from __future__ import annotations

import numpy as np

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.checks.consistency import require_ordered_clocks
from agvbench.diagnosis.context import require_runs
from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.readings import Readings
from agvbench.errors import CampaignError

NEVER_DRIVEN = "the drive was never commanded anything but neutral"


def insufficient_data(readings: Readings, header: HeaderLike) -> str:
    """Return why this campaign cannot be diagnosed, or an empty string.

    Raises
    ------
    CampaignError
        If it has too few runs, or if time goes back in many of them.
    """
    require_ordered_clocks(readings.refused, len(readings) + len(readings.refused), where=f"campaign {header.name}")
    require_runs(readings, header)
    if len(readings) < DATA.min_runs:
        raise CampaignError(
            "too few runs to diagnose",
            where=f"campaign {header.name}",
            value=len(readings),
            limit=f"at least {DATA.min_runs} that begin at rest",
            remedy="drive bench_calibration.py and bench_trajectories.py first",
        )
    commands = [run.commands for run in readings.runs]
    if all(np.all(c.drive == header.neutral.drive) for c in commands):
        return NEVER_DRIVEN
    if len({(f, r) for c in commands for f, r in zip(c.front.tolist(), c.rear.tolist(), strict=True)}) == 1:
        return "steering was never excited: its commands are the same in all runs"
    _, sizes = np.unique(readings.group, return_counts=True)
    if np.count_nonzero(sizes >= 2) < DATA.min_repeated_groups:
        least = DATA.min_repeated_groups
        return f"repeatability cannot be estimated: at least {least} commands must be driven twice or more"
    moved = np.nanmax(np.hypot(*np.moveaxis(readings.poses[..., :2] - readings.start[:, None, :2], -1, 0)), axis=1)
    if np.count_nonzero(moved > 0.1) < DATA.min_runs // 2:
        return f"the vehicle hardly moved: {np.count_nonzero(moved > 0.1)} runs went farther than 0.1 m"
    turned = np.nanmax(np.abs(readings.poses[..., 2] - readings.start[:, None, 2]), axis=1)
    if np.count_nonzero(turned > DATA.min_turn_rad) < DATA.min_repeated_groups:
        return "steering was never excited: hardly a run turns"
    return ""
