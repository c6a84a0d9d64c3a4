"""The part of a run in which one command was held and the vehicle had settled to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.errors import FitError
from agvbench.signals import robust_std
from agvbench.types import Command, Commands, Floats, Frames

MIN_SETTLE_S = 0.3
MIN_STEADY_S = 0.5
MIN_FRAMES = 10

_STRIDE_S = 0.2
_TOLERANCE = 0.02


@dataclass(frozen=True)
class Segment:
    """A command and the time [s] for which it was held."""

    command: Command
    begin_s: float
    end_s: float


def driven_segment(commands: Commands, last_frame_s: float, neutral: float | None = None) -> Segment:
    """Return the longest stretch of one command in which the vehicle was told to drive.

    The last row is the stop, and `neutral` (by default its drive command) says which rows stand still: steering
    is set before the vehicle drives. A run that never leaves neutral, as in the middle of the drive
    calibration, is taken for what it is: its longest stretch.
    """
    rows = np.column_stack([commands.drive, commands.front, commands.rear])
    changes = np.flatnonzero(np.any(np.diff(rows, axis=0) != 0.0, axis=1)) + 1
    starts = np.r_[0, changes].astype(np.int64)
    times = np.r_[commands.t_s[starts], max(last_frame_s, commands.t_s[-1])]
    stop = float(commands.drive[-1]) if neutral is None else neutral
    driven = commands.drive[starts] != stop
    # A stop is no measurement of standing still, unless nothing else was asked for.
    among = np.flatnonzero(driven) if driven.any() else np.arange(len(starts))
    longest = among[np.argmax(np.diff(times)[among])]
    return Segment(commands.at(int(starts[longest])), float(times[longest]), float(times[longest + 1]))


def steady_frames(frames: Frames, segment: Segment, *, where: str) -> Frames:
    """Return the clean frames of `segment` after speed and yaw rate have settled.

    Both are taken over 0.2 s. The level is the median over the second half of the segment; the vehicle has settled
    when it was last outside 2 % (or four standard deviations of the scatter, if that is more) of the level in the first
    half, and not before `MIN_SETTLE_S` after the command. What is still settling at half time is not waited for.

    Raises
    ------
    FitError
        If less than `MIN_STEADY_S` or fewer than `MIN_FRAMES` frames remain.
    """
    inside = frames.select((frames.t_s >= segment.begin_s) & (frames.t_s <= segment.end_s))
    begin_s = max(segment.begin_s + MIN_SETTLE_S, _settled(inside, segment))
    steady = inside.select(inside.t_s >= begin_s)
    seen_s = float(np.ptp(steady.t_s)) if len(steady) else 0.0
    if len(steady) < MIN_FRAMES or seen_s < MIN_STEADY_S:
        raise FitError(
            "too short a drive at one command to measure",
            where=where,
            value=f"{seen_s:.2f} s with {len(steady)} frames, of {segment.end_s - segment.begin_s:.2f} s",
            limit=f"at least {MIN_STEADY_S} s and {MIN_FRAMES} frames after settling",
            remedy="hold the command longer",
        )
    return steady


def _settled(frames: Frames, segment: Segment) -> float:
    """Return when speed and yaw rate were last off their level, within the first half of the segment [s]."""
    if len(frames) < MIN_FRAMES:
        return segment.begin_s
    later = np.minimum(np.searchsorted(frames.t_s, frames.t_s + _STRIDE_S), len(frames) - 1)
    dt = frames.t_s[later] - frames.t_s
    use = dt > 0.5 * _STRIDE_S
    heading = np.unwrap(frames.heading_rad)
    moved = np.hypot(frames.x_m[later] - frames.x_m, frames.y_m[later] - frames.y_m)
    middle = 0.5 * (segment.begin_s + segment.end_s)
    end = segment.begin_s
    for change in (moved, heading[later] - heading):
        rate, at = change[use] / dt[use], frames.t_s[use]
        end = max(end, _last_off_level(rate, at, middle))
    return end


def _last_off_level(rate: Floats, t_s: Floats, middle_s: float) -> float:
    second = rate[t_s >= middle_s]
    if not len(second):
        return -np.inf
    level = float(np.median(second))
    scatter = robust_std(second - level)
    off = (np.abs(rate - level) > max(_TOLERANCE * abs(level), 4.0 * scatter)) & (t_s < middle_s)
    return float(t_s[off][-1]) + _STRIDE_S / 2.0 if off.any() else -np.inf
