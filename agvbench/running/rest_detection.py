"""Rest detection: whether the vehicle is at rest, from frames, robust to noise and to single wrong frames."""

from __future__ import annotations

import numpy as np

from agvbench.types import Frames, Pose, wrap_angle

WINDOW_S = 0.4
SPEED_LIMIT_MPS = 0.01
"""Decides while driving whether a run may begin or end: stricter than reading, `agvbench.statistics.rest_poses`."""
YAW_RATE_LIMIT_RADPS = np.radians(2.0)
_FEWEST_FRAMES = 4
LEAST_RATE_HZ = (_FEWEST_FRAMES + 1) / (WINDOW_S / 2)
"""A camera that looks less often than this cannot lose a frame and still say so."""


def is_at_rest(frames: Frames, *, until_s: float, window_s: float = WINDOW_S) -> bool:
    """Return whether the vehicle moved slower than 10 mm/s and turned slower than 2°/s in the last `window_s`.

    The speed is the distance between the median positions of the window's two halves over the time between
    them, which 0.5 mm of noise moves by less than 2 mm/s at 120 Hz. The yaw rate is found likewise, since a vehicle may
    turn on the spot. Too few tracked frames count as moving.
    """
    age = until_s - frames.t_s
    recent = frames.tracked & (age >= 0.0) & (age <= window_s)
    older, newer = (recent & (age > window_s / 2)), (recent & (age <= window_s / 2))
    if min(older.sum(), newer.sum()) < _FEWEST_FRAMES:
        return False
    moved = np.hypot(
        np.median(frames.x_m[newer]) - np.median(frames.x_m[older]),
        np.median(frames.y_m[newer]) - np.median(frames.y_m[older]),
    )
    turn = wrap_angle(frames.heading_rad - frames.heading_rad[newer][-1])
    turned = abs(np.median(turn[newer]) - np.median(turn[older]))
    half_s = window_s / 2
    return bool(moved / half_s < SPEED_LIMIT_MPS and turned / half_s < YAW_RATE_LIMIT_RADPS)


def pose_before(frames: Frames, t_s: float) -> Pose | None:
    """Return the median pose of the tracked frames before `t_s`, or None where there is none."""
    before = frames.tracked & (frames.t_s <= t_s)
    if not before.any():
        return None
    heading = frames.heading_rad[before]
    reference = heading[0]
    turned = np.median(np.angle(np.exp(1j * (heading - reference))))
    return Pose(float(np.median(frames.x_m[before])), float(np.median(frames.y_m[before])), float(reference + turned))
