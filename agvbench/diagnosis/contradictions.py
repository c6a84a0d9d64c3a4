"""Campaigns that contradict themselves: the same commands, answered in wildly different ways."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.reading import Readings
from agvbench.diagnosis.residuals import misses
from agvbench.errors import CampaignError
from agvbench.types import Floats

_FAR_SHARE, _FAR_M = 0.3, 0.15
_AS_LONG = 0.05
_MOST_GROUPS = 0.25
_LEAST_WAY_M, _LEAST_SHARE, _FEWEST_PAIRS = 0.3, 0.15, 6
_GAP, _FAR_APART, _TIMES_AS_FAR = 1.5, 0.02, 6.0


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
        own = own[_as_long(readings, own, int(own[0]))]
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
    if far <= _MOST_GROUPS * repeated:
        _refuse_two_kinds(readings, path, where)
    else:
        raise CampaignError(
            "runs with the same commands contradict each other",
            where=where,
            value=f"{far} of {repeated} repeated commands; {example}",
            limit="a quarter of them",
            remedy="see that frames belong to their runs, and that one vehicle drove them all under one calibration",
        )


def _as_long(readings: Readings, runs: NDArray[np.int64], others: NDArray[np.int64] | int) -> NDArray[np.bool_]:
    """Whether runs were seen for as long as others: else their samples are of other times, and cannot be compared."""
    return np.asarray(np.isclose(readings.t_s[runs, -1], readings.t_s[others, -1], rtol=_AS_LONG))


def _refuse_two_kinds(readings: Readings, path: Floats, where: str) -> None:
    """Raise an error if repeats agree closely or are off by one and the same amount, with nothing between.

    Scatter, wear and places on the floor fill the gap between; two vehicles under one name, or two calibrations, do
    not.
    """
    pairs = np.array(
        [
            (i, j)
            for g in np.unique(readings.group)
            for i, j in combinations(np.flatnonzero(readings.group == g).tolist(), 2)
        ]
    ).reshape(-1, 2)
    seen = readings.seen[pairs[:, 0]] & readings.seen[pairs[:, 1]]
    usable = seen.any(axis=1) & _as_long(readings, pairs[:, 0], pairs[:, 1])
    pairs, last = pairs[usable], seen.shape[1] - 1 - np.argmax(seen[usable][:, ::-1], axis=1)
    ends = path[pairs, last[:, None]]
    way = np.hypot(*np.moveaxis(ends, -1, 0)).mean(axis=1)
    apart = np.hypot(*(ends[:, 0] - ends[:, 1]).T) / np.maximum(way, 1e-9)
    drove = way > _LEAST_WAY_M
    apart, pairs = np.sort(apart[drove]), pairs[drove][np.argsort(apart[drove])]
    count = len(apart)
    few = max(_FEWEST_PAIRS, int(_LEAST_SHARE * count))
    if count < 2 * few:
        return
    gaps = apart[few : count - few + 1] / np.maximum(apart[few - 1 : count - few], 1e-9)
    at = few + int(np.argmax(gaps))
    near, far = apart[:at], apart[at:]
    if gaps.max() < _GAP or far[0] < _FAR_APART or np.median(far) < _TIMES_AS_FAR * np.median(near):
        return
    i, j = pairs[at]
    raise CampaignError(
        "runs with the same commands are of two kinds",
        where=where,
        value=f"{len(far)} of {count} pairs of repeats end {far[0]:.0%} of the way apart or more, the others at most "
        f"{near[-1]:.0%}; {readings.runs[i].run_id} and {readings.runs[j].run_id} differ",
        remedy="see that one vehicle drove them all under one calibration, or diagnose its runs apart",
    )
