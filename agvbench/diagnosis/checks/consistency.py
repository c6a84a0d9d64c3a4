"""Consistency checks of a campaign: units, clocks, mirrored floor frames, and contradicting repeats."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.data.initial_pose import frame_noise
from agvbench.diagnosis.data.readings import BACK_IN_TIME, Readings
from agvbench.diagnosis.residuals.residuals import pose_residuals
from agvbench.errors import CampaignError
from agvbench.types import Floats, Run

_RATE_FACTOR = 30.0
_MAX_UNORDERED = 0.25
_FRAME_INTERVAL_S, _STRETCH = 0.3, 30
_MIN_TURN_RAD, _MIN_STEPS, _MIN_TURNING = 0.15, 5, 5
_MAX_BEND_RAD = 1.0
_TURN_RATIO_LIMITS = (0.5, 2.0)
_MIN_STEP_TO_NOISE = 10.0
"""A step so long has a direction known to 8°."""


def require_ordered_clocks(refused: Mapping[str, str], runs: int, *, where: str) -> None:
    """Raise an error if time goes back in many of the `runs`; `refused` maps excluded runs to their reason.

    Raises
    ------
    CampaignError
        If time goes back in more than a quarter of the runs.
    """
    back = [run_id for run_id, why in refused.items() if why.startswith(BACK_IN_TIME)]
    if len(back) > _MAX_UNORDERED * runs:
        raise CampaignError(
            BACK_IN_TIME,
            where=f"{where}: poses",
            value=f"in {len(back)} of {runs} runs, as in {back[0]}",
            limit="a quarter of the runs",
            remedy="give the poses of a run one clock",
        )


def require_plausible_units(runs: Sequence[Run], header: HeaderLike) -> None:
    """Raise an error if times are not in seconds, or if headings are inconsistent with the path.

    Metres and radians are checked when a campaign is opened (`agvbench.campaign.tables.motion_checks`). The checks here
    need no model either: the frame rate, and that a vehicle on an arc turns by as much as its path.

    Raises
    ------
    CampaignError
        If a check fails, naming the column.
    """
    where = f"campaign {header.name}: poses"
    times = [np.unique(run.frames.t_s) for run in runs if run.is_ok]  # duplicate frames have equal times
    steps_s = [np.median(np.diff(each)) for each in times if len(each) > 1]
    if not steps_s:
        return
    step_s = max(float(np.median(steps_s)), 1e-9)
    rate_hz = header.mocap_rate_hz
    if not 1.0 / _RATE_FACTOR < step_s * rate_hz < _RATE_FACTOR:
        raise CampaignError(
            "t_s is not in seconds",
            where=where,
            value=f"a frame every {step_s:.3g}",
            limit=f"about 1/{rate_hz:g} s, as mocap.rate_hz says",
            remedy="convert t_s to seconds, or correct mocap.rate_hz",
        )
    ratio = _turn_ratio(list(_tracks(runs)))
    if ratio is None or _TURN_RATIO_LIMITS[0] < ratio < _TURN_RATIO_LIMITS[1]:
        return
    value = f"the heading turns {ratio:.3g} times as far as the path"
    if -_TURN_RATIO_LIMITS[1] < ratio < -_TURN_RATIO_LIMITS[0]:
        what, remedy = "heading_rad and the floor are mirrored", "count headings counter-clockwise from x towards y"
    else:
        what, remedy = "heading_rad does not belong to x_m and y_m", "see that all three are of one body"
    raise CampaignError(what, where=where, value=value, limit="once", remedy=remedy)


def _tracks(runs: Sequence[Run]) -> Iterator[tuple[Floats, Floats, float]]:
    """Yield times (n,), poses (n, 3) with a continuous heading, and their noise [m], of each 9 s, one every 0.3 s."""
    for run in runs:
        f = run.frames
        seen = f.tracked.astype(np.bool_) & np.isfinite(f.t_s + f.x_m + f.y_m + f.heading_rad)
        order = np.flatnonzero(seen)[np.unique(f.t_s[seen], return_index=True)[1]]
        if not run.is_ok or len(order) < 2:
            continue
        t_s = f.t_s[order]
        poses = np.column_stack([f.x_m[order], f.y_m[order], np.unwrap(f.heading_rad[order])])
        noise_m = float(frame_noise(poses)[0])
        # Rounding may put the last time past the last frame.
        chosen = np.unique(np.searchsorted(t_s[:-1], np.arange(t_s[0], t_s[-1], _FRAME_INTERVAL_S)))
        for first in range(0, len(chosen), _STRETCH):
            own = chosen[first : first + _STRETCH]
            yield t_s[own], poses[own], noise_m


def _turn_ratio(tracks: list[tuple[Floats, Floats, float]]) -> float | None:
    """Return the rotation of headings relative to that of the direction of motion, the median of turning runs."""
    ratios = []
    for _, poses, noise_m in tracks:
        step = np.diff(poses[:, :2], axis=0)
        length = np.hypot(step[:, 0], step[:, 1])
        # A vehicle that turns on the spot, or stands, has the direction of its noise.
        moves = length > max(0.3 * np.max(length, initial=0.0), _MIN_STEP_TO_NOISE * noise_m)
        # Modulo half a turn: a reversing vehicle moves in the opposite direction along the same line.
        course = np.unwrap(np.arctan2(step[moves, 1], step[moves, 0]), period=np.pi)
        heading = (0.5 * (poses[1:, 2] + poses[:-1, 2]))[moves]
        # Where it turned on the spot between two steps, a quarter of a turn to either side is the same.
        corner = (np.diff(np.flatnonzero(moves)) > 1) | (np.abs(np.diff(course)) > _MAX_BEND_RAD)
        arc = np.cumsum(np.r_[False, corner][: len(course)])
        course, heading = (_centred(values, arc) for values in (course, heading))
        if len(course) >= _MIN_STEPS and np.std(course) > _MIN_TURN_RAD:
            ratios.append(float(course @ heading / (course @ course)))
    return float(np.median(ratios)) if len(ratios) >= _MIN_TURNING else None


def _centred(values: Floats, arc: NDArray[np.int64]) -> Floats:
    """Return values (n,) beside the mean of their arc (n,)."""
    return np.asarray(values - (np.bincount(arc, values) / np.bincount(arc))[arc])


_FAR_SHARE, _FAR_M = 0.3, 0.15
_DURATION_TOLERANCE = 0.05
_MAX_GROUPS = 0.25
_MIN_DISTANCE_M, _MIN_SHARE, _MIN_PAIRS = 0.3, 0.15, 6
_MIN_GAP_RATIO, _MIN_FAR_DISTANCE, _MIN_CLUSTER_RATIO = 1.5, 0.02, 6.0
_PARTS, _MIN_AGREEMENT, _SAME_START_M = 25, 0.9, 0.3


def require_consistent_repeats(readings: Readings, *, where: str) -> None:
    """Raise an error if repeats of many commands end at different places relative to their start poses.

    A single deviating run is an outlier. If a quarter of all repeated commands has a mean deviation of 30 % of the
    distance, frames and commands do not belong together, or several vehicles drove: no model describes that.

    Raises
    ------
    CampaignError
        If more than a quarter of the repeated commands deviates.
    """
    resting = np.broadcast_to(readings.start[:, None], readings.poses.shape)
    path = pose_residuals(readings, np.asarray(resting)).path[..., :2]
    deviating, repeated, example = 0, 0, ""
    for g in np.unique(readings.group):
        own = np.flatnonzero(readings.group == g)
        own = own[_same_duration(readings, own, int(own[0]))]
        both = readings.seen[own].all(axis=0)
        if len(own) < 2 or not both.any():
            continue
        repeated += 1
        ends = path[own][:, np.flatnonzero(both)[-1]]
        deviation = float(np.mean(np.hypot(*(ends - ends.mean(axis=0)).T)))
        distance = float(np.median(np.hypot(*ends.T)))
        if deviation > max(_FAR_SHARE * distance, _FAR_M):
            deviating += 1
            example = example or f"{readings.runs[own[0]].run_id} and its repeats end {deviation:.2f} m from their mean"
    if deviating <= _MAX_GROUPS * repeated:
        _require_single_cluster(readings, path, where)
    else:
        raise CampaignError(
            "runs with the same commands contradict each other",
            where=where,
            value=f"{deviating} of {repeated} repeated commands; {example}",
            limit="a quarter of them",
            remedy="see that frames belong to their runs, and that one vehicle drove them all under one calibration",
        )


def _same_duration(readings: Readings, runs: NDArray[np.int64], others: NDArray[np.int64] | int) -> NDArray[np.bool_]:
    """Return whether runs have about the duration of others, so that their samples can be compared."""
    return np.asarray(np.isclose(readings.t_s[runs, -1], readings.t_s[others, -1], rtol=_DURATION_TOLERANCE))


def _require_single_cluster(readings: Readings, path: Floats, where: str) -> None:
    """Raise an error if the deviations between repeats have two clusters that are two vehicles under one name.

    Random errors and wear fill the gap between clusters. Two vehicles, driven in turn, do not, and the runs of *each*
    agree with one another. A change during the campaign and a disturbance at a place make two clusters, too, but runs
    that they affect differ from one another, or time, a logged text or place divides them. These are evidence for the
    diagnosis.
    """
    pairs = np.array(
        [
            (i, j)
            for g in np.unique(readings.group)
            for i, j in combinations(np.flatnonzero(readings.group == g).tolist(), 2)
        ]
    ).reshape(-1, 2)
    seen = readings.seen[pairs[:, 0]] & readings.seen[pairs[:, 1]]
    usable = seen.any(axis=1) & _same_duration(readings, pairs[:, 0], pairs[:, 1])
    pairs, last = pairs[usable], seen.shape[1] - 1 - np.argmax(seen[usable][:, ::-1], axis=1)
    ends = path[pairs, last[:, None]]
    distance = np.hypot(*np.moveaxis(ends, -1, 0)).mean(axis=1)
    deviation = np.hypot(*(ends[:, 0] - ends[:, 1]).T) / np.maximum(distance, 1e-9)
    driven = distance > _MIN_DISTANCE_M
    deviation, pairs = np.sort(deviation[driven]), pairs[driven][np.argsort(deviation[driven])]
    count = len(deviation)
    smallest = max(_MIN_PAIRS, int(_MIN_SHARE * count))
    if count < 2 * smallest:
        return
    gaps = deviation[smallest : count - smallest + 1] / np.maximum(deviation[smallest - 1 : count - smallest], 1e-9)
    at = smallest + int(np.argmax(gaps))
    near, far = deviation[:at], deviation[at:]
    if (
        gaps.max() < _MIN_GAP_RATIO
        or far[0] < _MIN_FAR_DISTANCE
        or np.median(far) < _MIN_CLUSTER_RATIO * np.median(near)
        or not _are_two_kinds(readings.group, pairs[at:], pairs[:at])
        or _divided_by_time(readings.started_h[pairs], np.arange(count) >= at)
        or any(_divided_by_time(column[pairs], np.arange(count) >= at) for column in readings.logged.texts.T)
        or _divided_by_place(readings.start[pairs, :2], np.arange(count) >= at)
    ):
        return
    i, j = pairs[at]
    raise CampaignError(
        "runs with the same commands are of two kinds",
        where=where,
        value=f"{len(far)} of {count} pairs of repeats end {far[0]:.0%} of the way apart or more, the others at most "
        f"{near[-1]:.0%}; {readings.runs[i].run_id} and {readings.runs[j].run_id} differ",
        remedy="see that one vehicle drove them all under one calibration, or diagnose its runs apart",
    )


def _are_two_kinds(groups: NDArray[np.int64], far: NDArray[np.int64], near: NDArray[np.int64]) -> bool:
    """Return whether repeats that differ from the majority of their group agree with one another.

    `far` and `near` (pairs, 2) are repeats that differ and that agree, and `groups` (runs,) are their commands. Groups
    of two repeats cannot show it; a campaign of these alone is taken for one of two vehicles.
    """
    agreements = np.zeros((len(groups), len(groups)), dtype=np.bool_)
    differences = agreements.copy()
    agreements[tuple(near.T)] = agreements[tuple(near.T[::-1])] = True
    differences[tuple(far.T)] = differences[tuple(far.T[::-1])] = True
    agreeing = differing = 0
    for group in np.unique(groups[far]):
        runs = np.flatnonzero(groups == group)
        majority = runs[np.argmax(agreements[np.ix_(runs, runs)].sum(axis=1))]
        others = runs[differences[majority, runs]]
        agreeing += int(np.count_nonzero(agreements[np.ix_(others, others)])) // 2
        differing += int(np.count_nonzero(differences[np.ix_(others, others)])) // 2
    return agreeing >= _MIN_AGREEMENT * (agreeing + differing)


def _divided_by_time(hours: Floats, far: NDArray[np.bool_]) -> bool:
    """Return whether one part of the campaign differs from the rest: pairs are far if one run is in it.

    `hours` (pairs, 2) are the times at which the runs began, and `far` (pairs,) says which pairs are far.
    """
    times = np.quantile(hours, np.linspace(0.0, 1.0, _PARTS))
    for begin, end in combinations([*times.tolist(), np.inf], 2):
        inside = (hours >= begin) & (hours < end)
        if np.mean((inside[:, 0] != inside[:, 1]) == far) > _MIN_AGREEMENT:
            return True
    return False


def _divided_by_place(starts: Floats, far: NDArray[np.bool_]) -> bool:
    """Return whether repeats from the same start are near; `starts` (pairs, 2, 2) are start positions [m]."""
    same = np.hypot(*np.diff(starts, axis=1)[:, 0].T) <= _SAME_START_M
    return bool(np.count_nonzero(same) >= _MIN_PAIRS and np.mean(~far[same]) > _MIN_AGREEMENT)
