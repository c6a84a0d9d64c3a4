"""Rest poses: poses before the first command and after the stop, estimated from noisy frames.

Frames may be untracked, doubled, late or wildly wrong. Both poses are means over a window at rest after
outlying frames have been left out, with the standard error of that mean. The standard errors assume that the
noise of one frame says nothing about the next; where a camera's noise drifts slowly they are lower bounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import FitError
from agvbench.signals import MAD_TO_STD, median
from agvbench.types import Floats, Frames, Pose, Run, kept_by_frames, wrap_angle

WINDOW_S = 0.5
STILL_MOVING_AT_END = "still moving when the frames end"
SPEED_LIMIT_MPS = 0.02
"""Of a recorded vehicle; twice the limit while driving (`agvbench.running.rest_detection`), which admits runs."""
_FEWEST_FRAMES = 8
_WILD_SCALES = 6.0
# The least plausible noise: cameras quantise, and a noise of zero would make every frame but one an outlier.
_LEAST_M, _LEAST_RAD = 1e-4, 2e-4


@dataclass(frozen=True)
class RestPose:
    """A pose at rest in the floor frame, with standard errors [m, m, rad] (NaN from a single frame).

    ``speed_mps`` and ``turn_rate_radps`` are what the two halves of the window say of motion in it, noise included; NaN
    from fewer than eight frames.
    """

    pose: Pose
    stderr_x_m: float
    stderr_y_m: float
    stderr_heading_rad: float
    frames: int
    left_out: int
    speed_mps: float = math.nan
    turn_rate_radps: float = math.nan

    @property
    def stderr_position_m(self) -> float:
        """Return the standard error [m] of the position along any one direction."""
        return math.hypot(self.stderr_x_m, self.stderr_y_m) / math.sqrt(2.0)


def start_pose(run: Run) -> RestPose:
    """Return the pose at rest before the first command, from the last 0.5 s in which it was seen.

    Raises
    ------
    FitError
        If no frame was tracked before the first command.
    """
    rest = _before_first_command(run.frames)
    if rest is None:
        raise FitError("no tracked frame at rest before the first command", where=run.run_id)
    return rest


@kept_by_frames
def _before_first_command(frames: Frames) -> RestPose | None:
    frames = _tracked(frames)
    before = frames.select(frames.t_s <= 0.0)
    return _mean_pose(before.select(before.t_s > before.t_s[-1] - WINDOW_S)) if len(before) else None


def end_pose(run: Run) -> RestPose:
    """Return the pose at rest after the stop (the last command), from at most the last 0.5 s.

    The window is halved, from its older end, while the vehicle still settles in it.

    Raises
    ------
    FitError
        If no frame was tracked after the stop, or the vehicle still moves when the frames end.
    """
    stop_s = float(run.commands.t_s[-1]) if len(run.commands) else 0.0
    rest, speed = _after_stop(run.frames, stop_s)
    if rest is None:
        raise FitError("no tracked frame after the stop", where=run.run_id)
    if speed > SPEED_LIMIT_MPS:
        raise FitError(
            STILL_MOVING_AT_END,
            where=run.run_id,
            value=f"{speed:.3f} m/s",
            limit=f"{SPEED_LIMIT_MPS} m/s",
        )
    return rest


@kept_by_frames
def _after_stop(frames: Frames, stop_s: float) -> tuple[RestPose | None, float]:
    """Return the pose of the settled window after `stop_s`, None without frames, and the speed [m/s] in it."""
    frames = _tracked(frames)
    after = frames.select(frames.t_s > stop_s)
    if not len(after):
        return None, 0.0
    window = _settled(after.select(after.t_s > after.t_s[-1] - WINDOW_S))
    return _mean_pose(window), _drift(window)[1]


def _tracked(frames: Frames) -> Frames:
    """Return the tracked, finite frames in order of capture, each capture time once."""
    finite = np.isfinite(frames.t_s + frames.x_m + frames.y_m + frames.heading_rad)
    kept = frames.select(frames.tracked.astype(np.bool_) & finite)
    return kept.select(np.unique(kept.t_s, return_index=True)[1])


def _settled(window: Frames) -> Frames:
    while len(window) >= 2 * _FEWEST_FRAMES:
        moved, _, tolerance = _drift(window)
        if moved <= tolerance:
            break
        window = window.select(np.arange(len(window) // 2, len(window)))
    return window


def _drift(window: Frames) -> tuple[float, float, float]:
    """Return how far [m], how fast [m/s] the window's halves lie apart, and the distance [m] that noise explains."""
    if len(window) < _FEWEST_FRAMES:
        return 0.0, 0.0, 0.0
    half = len(window) // 2
    older, newer = np.arange(half), np.arange(half, len(window))
    moved = math.hypot(*(median(v[newer]) - median(v[older]) for v in (window.x_m, window.y_m)))
    apart_s = median(window.t_s[newer]) - median(window.t_s[older])
    # The noise is read from second differences, which steady motion does not change.
    bends = np.concatenate([np.diff(window.x_m, 2), np.diff(window.y_m, 2)])
    noise = MAD_TO_STD * median(np.abs(bends)) / math.sqrt(6.0)
    tolerance = _LEAST_M + 4.0 * 1.2533 * noise * math.sqrt(2.0 / half)
    return moved, max(0.0, moved - tolerance) / apart_s, tolerance


def _mean_pose(window: Frames) -> RestPose:
    heading, turned = _unwrapped(window.heading_rad)
    kept = ~(_wild(window.x_m, _LEAST_M) | _wild(window.y_m, _LEAST_M) | _wild(turned, _LEAST_RAD))
    if not kept.any():
        kept[:] = True
    x, y, h = window.x_m[kept], window.y_m[kept], turned[kept]
    pose = Pose(float(x.mean()), float(y.mean()), wrap_angle(heading + float(h.mean())))
    velocity = _velocities(window.t_s[kept], x, y, h)
    errors = _stderr(x), _stderr(y), _stderr(h)
    return RestPose(pose, *errors, len(x), len(window) - len(x), math.hypot(*velocity[:2]), velocity[2])


def _velocities(t_s: Floats, *columns: Floats) -> list[float]:
    """Return the difference of the means of both halves of each column, per time between them."""
    if len(t_s) < _FEWEST_FRAMES:
        return [math.nan] * len(columns)
    half = len(t_s) // 2
    apart_s = float(t_s[half:].mean() - t_s[:half].mean())
    return [float(values[half:].mean() - values[:half].mean()) / apart_s for values in columns]


def _unwrapped(heading: Floats) -> tuple[float, Floats]:
    """Return a central heading and every heading's wrapped distance from it."""
    centre = math.atan2(median(np.sin(heading)), median(np.cos(heading)))
    return centre, np.angle(np.exp(1j * (heading - centre)))


def _wild(values: Floats, least: float) -> NDArray[np.bool_]:
    away = np.abs(values - median(values))
    wild: NDArray[np.bool_] = away > _WILD_SCALES * max(least, MAD_TO_STD * median(away))
    return wild


def _stderr(values: Floats) -> float:
    return float(values.std(ddof=1) / math.sqrt(len(values))) if len(values) > 1 else math.nan
