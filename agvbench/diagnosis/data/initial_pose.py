"""The initial pose of a run, and whether the vehicle is at rest before it drives.

Some runs are recorded from half a second before the first command, others from the first command on. A recording that
was cut at the first command has a single frame before it. The vehicle is also at rest while the drive command is
neutral, whatever the steering commands are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import FitError
from agvbench.signals import MAD_TO_STD
from agvbench.statistics.rest_poses import SPEED_LIMIT_MPS, start_pose
from agvbench.types import Command, Commands, Floats, Frames, Run

_LAST_S, _EARLY_S = 0.2, 0.2
_STANDSTILL_M = 0.005
_MIN_FRAMES = 8
_MAX_DELAY_S = 0.1
_TYPICAL_MPS = 0.3
_MIN_M, _MIN_RAD = 1e-4, 2e-4
_MAX_ROWS_PER_S = 3.0


def shift_commands_half_a_row(run: Run) -> Run:
    """Return an imported run with its changes of command half a row earlier; return any other run unchanged.

    Each row of a recording contains command and pose, so that a change of command appears in the first row after it.
    With that row's time stamp, the camera latency would be biased by minus half a sampling period.
    """
    if "source_row" not in run.extra or len(run.commands) < 2 or len(times := np.unique(run.frames.t_s)) < 2:
        return run
    t_s = run.commands.t_s.copy()
    t_s[1:] -= 0.5 * float(np.median(np.diff(times)))
    return replace(run, commands=replace(run.commands, t_s=np.maximum.accumulate(t_s)))


def is_driven(commands: Commands, neutral: Command, *, turns_on_the_spot: bool) -> NDArray[np.bool_]:
    """Return whether the vehicle moves under each command (n,): one that `turns_on_the_spot` also by the front one."""
    turned = turns_on_the_spot & (commands.front != neutral.front)
    return np.asarray((commands.drive != neutral.drive) | turned)


def first_drive_s(run: Run, neutral: Command, *, turns_on_the_spot: bool = False) -> float:
    """Return the time of the first command under which the vehicle moves; ∞ if there is none."""
    driven = np.flatnonzero(is_driven(run.commands, neutral, turns_on_the_spot=turns_on_the_spot))
    return float(run.commands.t_s[driven[0]]) if len(driven) else np.inf


def starts_at_rest(run: Run, neutral: Command, *, turns_on_the_spot: bool = False) -> bool:
    """Return whether the vehicle was at rest in the last frames before its first drive command.

    The camera's clock may be early by up to 0.2 s. If there are no such frames, a run with few commands is taken to
    start at rest. A run whose commands change continually is taken for a piece of free driving.
    """
    usable = run.frames.select(run.frames.tracked.astype(np.bool_))
    for until in dict.fromkeys((0.0, first_drive_s(run, neutral, turns_on_the_spot=turns_on_the_spot))):
        frames = usable.select(usable.t_s <= until)
        if len(frames) >= 2:
            earlier = frames.select(frames.t_s <= frames.t_s[-1] - _EARLY_S)
            return _is_at_rest(frames) or (len(earlier) >= _MIN_FRAMES and _is_at_rest(earlier))
    if np.any(run.frames.t_s < 0.0):
        return True
    length_s = float(np.ptp(run.frames.t_s)) if len(run.frames) else 0.0
    return len(run.commands) <= max(3.0, _MAX_ROWS_PER_S * length_s)


def _is_at_rest(frames: Frames) -> bool:
    last = frames.select(frames.t_s > frames.t_s[-1] - _LAST_S)
    span_s = float(last.t_s[-1] - last.t_s[0])
    half = max(len(last) // 2, 1)
    older, newer = (np.array([np.median(v[part]) for v in (last.x_m, last.y_m)]) for part in _halves(half))
    return float(np.hypot(*(newer - older))) <= max(SPEED_LIMIT_MPS * span_s, _STANDSTILL_M)


def _halves(half: int) -> tuple[slice, slice]:
    return slice(0, half), slice(-half, None)


def initial_pose(
    run: Run, frames: Frames, neutral: Command | None, *, turns_on_the_spot: bool = False
) -> tuple[Floats, Floats]:
    """Return the pose at rest at the start (3,) [m, m, rad] and its standard errors (3,), from cleaned `frames`.

    Raises
    ------
    FitError
        If there is no pose before the first drive command nor within 0.1 s after it.
    """
    drive_s = 0.0 if neutral is None else first_drive_s(run, neutral, turns_on_the_spot=turns_on_the_spot)
    # Cleaning may remove the frames at rest if the pose jumps at the start: they count all the same.
    seen_s = run.frames.t_s[run.frames.tracked.astype(np.bool_)]
    before = int(np.count_nonzero(seen_s <= 0.0))
    if before < _MIN_FRAMES and np.count_nonzero(seen_s <= drive_s) > before:
        later = min(drive_s, float(frames.t_s[-1]))
        run = replace(run, frames=replace(run.frames, t_s=run.frames.t_s - later))
    elif before == 0 and neutral is not None:
        return _first_seen(run, frames)
    rest = start_pose(run)
    stderr = np.array([rest.stderr_x_m, rest.stderr_y_m, rest.stderr_heading_rad])
    return np.array(rest.pose), np.where(np.isfinite(stderr), stderr, frame_noise(unwrapped_poses(frames))[[0, 0, 1]])


def _first_seen(run: Run, frames: Frames) -> tuple[Floats, Floats]:
    """Return the first measured pose, with standard errors from frame noise and the distance possibly driven."""
    delay_s = float(frames.t_s[0])
    if delay_s > _MAX_DELAY_S:
        raise FitError("not seen at rest nor within 0.1 s of the first command", where=run.run_id)
    position, heading = frame_noise(unwrapped_poses(frames))
    deviation = float(np.hypot(position, _TYPICAL_MPS * delay_s))
    pose = np.array([frames.x_m[0], frames.y_m[0], frames.heading_rad[0]])
    return pose, np.array([deviation, deviation, heading])


def unwrapped_poses(frames: Frames) -> Floats:
    """Return x, y and the continuous heading of each frame, (n, 3)."""
    return np.column_stack([frames.x_m, frames.y_m, np.unwrap(frames.heading_rad)])


def frame_noise(motion: Floats) -> Floats:
    """Return the standard deviation of one frame, (2,): position [m] and heading [rad], from third differences.

    `motion` (n, 3) is x, y and the continuous heading.
    """
    differences = np.abs(np.diff(motion, 3, axis=0)) / np.sqrt(20.0)
    if not len(differences):
        return np.array([_MIN_M, _MIN_RAD])
    scale = MAD_TO_STD * np.median(differences, axis=0)
    return np.maximum([float(np.hypot(scale[0], scale[1])) / np.sqrt(2.0), float(scale[2])], [_MIN_M, _MIN_RAD])
