"""Driven poses against a planned path at the same progress.

A pose belongs to the point of the path that dynamic time warping pairs it with (Sakoe and Chiba 1978, IEEE Transactions
on Acoustics, Speech and Signal Processing 26, 43–49): both begin and end together and neither goes back. The nearest
point would be wrong where a path crosses itself, turns back at a cusp, or is driven twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.compiled import cached_njit
from agvbench.types import Floats

Indices = NDArray[np.int64]
_MOST_POINTS = 600
_LEAST_STEP_M = 5e-3
_LEVER_M = 0.2
"""How far an error of heading moves a point of the vehicle: it decides between points of equal position."""


@dataclass(frozen=True)
class PathErrors:
    """Errors of driven poses against the planned path, evenly spread over the way driven; arrays of shape (n,).

    ``progress_m`` [m] is the length of the path up to the matched point. ``cross_track_m`` [m] is the offset to the
    left of the direction in which the path goes there, ``along_track_m`` [m] that in its direction. ``heading_rad``
    [rad] is the heading minus that of the path.
    """

    progress_m: Floats
    cross_track_m: Floats
    along_track_m: Floats
    heading_rad: Floats


def track_path(driven: Floats, planned: Floats) -> PathErrors | None:
    """Return the errors of `driven` against `planned`, both of shape (n, 4): t [s], x, y [m], heading [rad, unwrapped].

    None where either does not move.
    """
    length_m = float(_way(planned)[-1])
    step_m = max(_LEAST_STEP_M, length_m / _MOST_POINTS)
    path, poses = _spread(planned, step_m), _moved(driven, step_m)
    if len(path) < 2 or len(poses) < 2:
        return None
    matched = _nearest_of_pairs(poses[:, 1:], path[:, 1:])
    going = _directions(path)[matched]
    offset = poses[:, 1:3] - path[matched, 1:3]
    left = np.column_stack([-going[:, 1], going[:, 0]])
    turned = poses[:, 3] - path[matched, 3]
    return PathErrors(
        progress_m=_way(path)[matched],
        cross_track_m=np.sum(offset * left, axis=1),
        along_track_m=np.sum(offset * going, axis=1),
        heading_rad=turned - 2.0 * np.pi * np.round(turned / (2.0 * np.pi)),
    )


def _way(poses: Floats) -> Floats:
    """Return the length [m] of the path up to each pose, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(poses[:, 1]), np.diff(poses[:, 2])))])


def _spread(planned: Floats, step_m: float) -> Floats:
    """Return points of a path about every `step_m`, its corners between them rounded off."""
    way = _way(planned)
    keep = np.concatenate([[True], np.diff(way) > 0.0])
    wanted = np.linspace(0.0, way[-1], max(2, round(way[-1] / step_m) + 1)) if way[-1] > step_m else np.zeros(1)
    return np.column_stack([np.interp(wanted, way[keep], planned[keep, k]) for k in range(4)])


def _moved(driven: Floats, step_m: float) -> Floats:
    """Return the poses that lie at least `step_m` from the one kept before: a vehicle at rest counts once."""
    return np.asarray(driven[_kept(np.ascontiguousarray(driven[:, 1:3]), step_m)])


@cached_njit()
def _kept(xy: Floats, step_m: float) -> list[int]:  # pragma: no cover - compiled
    kept = [0]
    for k in range(1, len(xy)):
        last = kept[-1]
        if (xy[k, 0] - xy[last, 0]) ** 2 + (xy[k, 1] - xy[last, 1]) ** 2 >= step_m * step_m:
            kept.append(k)
    return kept


def _directions(path: Floats) -> Floats:
    """Return the unit vectors (n, 2) in which a path goes: between its neighbours, so that a cusp has one of both."""
    ahead = np.diff(path[:, 1:3], axis=0)
    ahead = np.vstack([ahead, ahead[-1:]])
    return np.asarray(ahead / np.maximum(np.hypot(*ahead.T), 1e-12)[:, np.newaxis])


def _nearest_of_pairs(poses: Floats, path: Floats) -> Indices:
    """Return, for each pose, the nearest of the points that the alignment pairs it with."""
    return _aligned(*(np.ascontiguousarray(np.column_stack([p[:, :2], _LEVER_M * p[:, 2]])) for p in (poses, path)))


@cached_njit()
def _squared_distances(a: Floats, b: Floats) -> Floats:  # pragma: no cover - compiled
    """Return the squared distance of each row of `a` (n, 3) from each of `b` (m, 3), shape (n, m)."""
    found = np.empty((len(a), len(b)))
    for i in range(len(a)):
        for j in range(len(b)):
            found[i, j] = (a[i, 0] - b[j, 0]) ** 2 + (a[i, 1] - b[j, 1]) ** 2 + (a[i, 2] - b[j, 2]) ** 2
    return found


@cached_njit()
def _least_sums(cost: Floats) -> Floats:  # pragma: no cover - compiled
    """Return the least sums of the costs (n, m) of pairs from the first pair to each, shape (n + 1, m + 1).

    The first row and column are infinite: nothing comes before the first pair.
    """
    total = np.full((len(cost) + 1, cost.shape[1] + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(len(cost)):
        for j in range(cost.shape[1]):
            total[i + 1, j + 1] = cost[i, j] + min(total[i, j], total[i, j + 1], total[i + 1, j])
    return total


@cached_njit()
def _aligned(a: Floats, b: Floats) -> Indices:  # pragma: no cover - compiled
    """Return, for each row of `a` (n, 3), the nearest row of `b` (m, 3) among those it is paired with, shape (n,)."""
    cost = _squared_distances(a, b)
    total = _least_sums(cost)
    i, j = len(a) - 1, len(b) - 1
    nearest, least = np.full(len(a), j), np.full(len(a), np.inf)
    while i >= 0:
        if cost[i, j] < least[i]:
            least[i], nearest[i] = cost[i, j], j
        both, one_back, same = total[i, j], total[i, j + 1], total[i + 1, j]
        if both <= one_back and both <= same:
            i, j = i - 1, j - 1
        elif one_back <= same:
            i -= 1
        else:
            j -= 1
    return nearest
