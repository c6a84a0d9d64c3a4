"""Frames into paths that are worth drawing: in order, without jumps, no more points than an eye can resolve."""

from __future__ import annotations

import numpy as np

from agvbench.types import Floats, Frames

_JUMP_M = 0.1
_NEIGHBOURS = 5
_FEWEST_POINTS, _MOST_POINTS, _POINTS_PER_M = 80, 600, 20.0


def drawn_path(frames: Frames) -> Floats:
    """Return poses spread evenly over the way driven, shape (n, 4): t [s], x, y [m], heading [rad].

    There is one every 50 mm, but at least 80 in all (if there are so many) and at most 600.

    Frames that are not tracked, or lie more than 0.1 m from the median of the five around them, are left out: this is
    for looking at, not for measuring.
    """
    poses = _in_order(frames)
    poses = poses[_smooth(poses)]
    if len(poses) <= _FEWEST_POINTS:
        return poses
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(poses[:, 1]), np.diff(poses[:, 2])))])
    wanted = np.linspace(0.0, way[-1], int(np.clip(way[-1] * _POINTS_PER_M, _FEWEST_POINTS, _MOST_POINTS)))
    return np.asarray(poses[np.unique(np.searchsorted(way, wanted).clip(0, len(poses) - 1))])


def smooth_poses(frames: Frames) -> Floats:
    """Return every tracked pose in order of capture and without jumps, shape (n, 4)."""
    poses = _in_order(frames)
    return np.asarray(poses[_smooth(poses)])


def _in_order(frames: Frames) -> Floats:
    poses = np.column_stack([frames.t_s, frames.x_m, frames.y_m, frames.heading_rad])
    poses = poses[frames.tracked.astype(np.bool_) & np.isfinite(poses).all(axis=1)]
    return np.asarray(poses[np.unique(poses[:, 0], return_index=True)[1]])


def _smooth(poses: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    if len(poses) < _NEIGHBOURS:
        return np.ones(len(poses), dtype=np.bool_)
    half = _NEIGHBOURS // 2
    padded = np.pad(poses[:, 1:3], ((half, half), (0, 0)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS, axis=0)
    away = np.hypot(*(poses[:, 1:3] - np.median(windows, axis=2)).T)
    smooth: np.ndarray[tuple[int], np.dtype[np.bool_]] = away <= _JUMP_M
    return smooth
