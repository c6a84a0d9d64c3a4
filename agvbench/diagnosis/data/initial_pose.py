"""Where a run begins: whether the vehicle rests before it drives, and its pose there.

Some record half a second before the first command, others begin with it, and a recording that was cut where driving
begins has a single frame before. A vehicle also rests while the drive is still at neutral, whatever the steering does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.errors import FitError
from agvbench.signals import MAD_TO_STD
from agvbench.statistics.rest_poses import SPEED_LIMIT_MPS, start_pose
from agvbench.types import Floats, Frames, Run

_LAST_S = 0.2
_STILL_M = 0.005
_ENOUGH_FRAMES = 8
_LATEST_S = 0.1
_LIKELY_MPS = 0.3
_LEAST_M, _LEAST_RAD = 1e-4, 2e-4
_FEW_ROWS_PER_S = 3.0


def between_rows(run: Run) -> Run:
    """Return an imported run with its changes of command half a row earlier; any other run as it is.

    A recording has the command beside the pose: what changes is first seen in the row after it changed. Taken at that
    row's time, every camera would look half a period early.
    """
    if "source_row" not in run.extra or len(run.commands) < 2 or len(times := np.unique(run.frames.t_s)) < 2:
        return run
    t_s = run.commands.t_s.copy()
    t_s[1:] -= 0.5 * float(np.median(np.diff(times)))
    return replace(run, commands=replace(run.commands, t_s=np.maximum.accumulate(t_s)))


def goes_s(run: Run, neutral: float) -> float:
    """Return when the first command is given that drives; ∞ where none does."""
    driven = np.flatnonzero(run.commands.drive != neutral)
    return float(run.commands.t_s[driven[0]]) if len(driven) else np.inf


def rests(run: Run, neutral: float) -> bool:
    """Return whether the vehicle stood still in the last frames before it was first driven.

    Where there are no such frames, a run of few commands is taken to start from rest; one whose command changes all the
    time is a piece of free driving.
    """
    usable = run.frames.select(run.frames.tracked.astype(np.bool_))
    for until in dict.fromkeys((0.0, goes_s(run, neutral))):
        frames = usable.select(usable.t_s <= until)
        if len(frames) >= 2:
            return _still(frames)
    if np.any(run.frames.t_s < 0.0):
        return True
    length_s = float(np.ptp(run.frames.t_s)) if len(run.frames) else 0.0
    return len(run.commands) <= max(3.0, _FEW_ROWS_PER_S * length_s)


def _still(frames: Frames) -> bool:
    last = frames.select(frames.t_s > frames.t_s[-1] - _LAST_S)
    span_s = float(last.t_s[-1] - last.t_s[0])
    half = max(len(last) // 2, 1)
    older, newer = (np.array([np.median(v[part]) for v in (last.x_m, last.y_m)]) for part in _halves(half))
    return float(np.hypot(*(newer - older))) <= max(SPEED_LIMIT_MPS * span_s, _STILL_M)


def _halves(half: int) -> tuple[slice, slice]:
    return slice(0, half), slice(-half, None)


def start_of(run: Run, frames: Frames, neutral: float | None) -> tuple[Floats, Floats]:
    """Return the pose at rest at the start (3,) [m, m, rad] and its standard errors (3,), from cleaned `frames`.

    Raises
    ------
    FitError
        If the vehicle was not seen before it was driven, nor shortly after.
    """
    go_s = 0.0 if neutral is None else goes_s(run, neutral)
    # Cleaning may leave out where the vehicle stood, if its pose jumps as it sets off: it stood there all the same.
    seen_s = run.frames.t_s[run.frames.tracked.astype(np.bool_)]
    before = int(np.count_nonzero(seen_s <= 0.0))
    if before < _ENOUGH_FRAMES and np.count_nonzero(seen_s <= go_s) > before:
        later = min(go_s, float(frames.t_s[-1]))
        run = replace(run, frames=replace(run.frames, t_s=run.frames.t_s - later))
    elif before == 0 and neutral is not None:
        return _first_seen(run, frames)
    rest = start_pose(run)
    stderr = np.array([rest.stderr_x_m, rest.stderr_y_m, rest.stderr_heading_rad])
    return np.array(rest.pose), np.where(np.isfinite(stderr), stderr, frame_noise(motion_of(frames))[[0, 0, 1]])


def _first_seen(run: Run, frames: Frames) -> tuple[Floats, Floats]:
    """Return the first pose seen, as uncertain as a frame is and as far as the vehicle may have gone."""
    late_s = float(frames.t_s[0])
    if late_s > _LATEST_S:
        raise FitError("not seen at rest nor within 0.1 s of the first command", where=run.run_id)
    position, heading = frame_noise(motion_of(frames))
    off = float(np.hypot(position, _LIKELY_MPS * late_s))
    pose = np.array([frames.x_m[0], frames.y_m[0], frames.heading_rad[0]])
    return pose, np.array([off, off, heading])


def motion_of(frames: Frames) -> Floats:
    """Return x, y and the continuous heading of each frame, (n, 3)."""
    return np.column_stack([frames.x_m, frames.y_m, np.unwrap(frames.heading_rad)])


def frame_noise(motion: Floats) -> Floats:
    """Return the standard deviation of one frame, (2,): position [m] and heading [rad], from third differences.

    `motion` (n, 3) is x, y and the continuous heading.
    """
    bends = np.abs(np.diff(motion, 3, axis=0)) / np.sqrt(20.0)
    if not len(bends):
        return np.array([_LEAST_M, _LEAST_RAD])
    scale = MAD_TO_STD * np.median(bends, axis=0)
    return np.maximum([float(np.hypot(scale[0], scale[1])) / np.sqrt(2.0), float(scale[2])], [_LEAST_M, _LEAST_RAD])
