"""Campaigns that contradict themselves: the same commands, answered in wildly different ways."""

from __future__ import annotations

import numpy as np

from agvbench.diagnosis.reading import Readings
from agvbench.diagnosis.residuals import misses
from agvbench.errors import CampaignError

_FAR_SHARE, _FAR_M = 0.3, 0.15
_MOST_GROUPS = 0.25


def refuse_contradictions(readings: Readings, *, where: str) -> None:
    """Raise an error if repeats of many commands went to different places, as seen from where they began.

    One run that went wrong is an outlier. When in a quarter of all repeated commands the typical run is off by a third
    of the way, frames and commands do not belong together, or there was more than one vehicle: no model describes that.

    Raises
    ------
    CampaignError
        If that is so.
    """
    stood = np.broadcast_to(readings.start[:, None], readings.poses.shape)
    path = misses(readings, np.asarray(stood)).path[..., :2]
    far, repeated, example = 0, 0, ""
    for g in np.unique(readings.group):
        own = np.flatnonzero(readings.group == g)
        both = readings.seen[own].all(axis=0)
        if len(own) < 2 or not both.any():
            continue
        repeated += 1
        ends = path[own][:, np.flatnonzero(both)[-1]]
        off = float(np.mean(np.hypot(*(ends - ends.mean(axis=0)).T)))
        way = float(np.median(np.hypot(*ends.T)))
        if off > max(_FAR_SHARE * way, _FAR_M):
            far += 1
            example = example or f"{readings.runs[own[0]].run_id} and its repeats end {off:.2f} m from their mean"
    if far > _MOST_GROUPS * repeated:
        raise CampaignError(
            "runs with the same commands contradict each other",
            where=where,
            value=f"{far} of {repeated} repeated commands; {example}",
            limit="a quarter of them",
            remedy="see that frames belong to their runs, and that one vehicle drove them all under one calibration",
        )
