"""Axle angles and speed of one run, from the part in which the vehicle had settled to one command."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agvbench.calibration.measurement.frames import FrameQuality, inspect_frames
from agvbench.calibration.measurement.path import correlation_factor, fit_path, robust_slope, slope_stderr
from agvbench.errors import FitError
from agvbench.signals import robust_std
from agvbench.types import Command, Commands, Floats, Frames, Run, wrap_angle
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import axle_angle_stderrs, axle_angles_from_curvature

_STANDS_M = 0.01
_STANDS_SIGMAS = 10.0
_MAX_RMS_SHARE = 0.01
_MAX_RMS_SIGMAS = 4.0


@dataclass(frozen=True, kw_only=True)
class RunMeasurement:
    """What a run at one command says about the vehicle.

    ``front_rad``, ``rear_rad`` (counter-clockwise positive) and ``speed_mps`` of the marker centroid (backward
    negative), each with its standard error; ``curvature_per_m`` (heading change per metre driven forward) and
    ``sideslip_rad`` (direction of travel against heading) that the angles follow from; ``arc_rad`` turned and
    ``rms_m`` about the path; ``begin_s``, ``end_s`` of the steady part and the ``frames_used`` of it. A vehicle that
    stands still has no axle angles: they are NaN, and the speed is what its frames drift.
    """

    run_id: str
    command: Command
    front_rad: float = math.nan
    rear_rad: float = math.nan
    speed_mps: float
    front_stderr_rad: float = math.nan
    rear_stderr_rad: float = math.nan
    speed_stderr_mps: float
    curvature_per_m: float = math.nan
    curvature_stderr_per_m: float = math.nan
    sideslip_rad: float = math.nan
    sideslip_stderr_rad: float = math.nan
    arc_rad: float
    rms_m: float
    begin_s: float
    end_s: float
    frames_used: int
    quality: FrameQuality

    @property
    def moves(self) -> bool:
        """Whether the vehicle moved, so that its axle angles are known."""
        return math.isfinite(self.front_rad)


def measure_run(run: Run, geometry: Geometry, *, neutral: Command | None = None) -> RunMeasurement:
    """Measure both axle angles and the speed of a run in which one command was held (thesis fig. 7.1 and 7.2).

    Frames are cleaned; from the steady part of the longest stretch of one command the path is fitted as a circle
    that may be a line. The sideslip is the mean over all frames, without outliers, of the path's tangent against the
    heading: the thesis takes the last frame's heading alone, √n times as noisy. Both axle angles follow from
    curvature and sideslip (`axle_angles_from_curvature`), and the speed is the robust slope of arc length over time
    (`robust_slope`). Standard errors are propagated, and widened where neighbouring frames share their error.

    Parameters
    ----------
    run
        Commands and frames; frames at rest before and after do no harm.
    geometry
        Where the axles are.
    neutral
        Command at which the vehicle stands; by default the drive command of the run's last row.

    Raises
    ------
    FitError
        If the run has no usable frames, held no command long enough, or did not follow one arc.
    """
    segment, steady, quality = steady_part(run, neutral)
    if _stands_still(steady):
        return _stands(run.run_id, segment, steady, quality)
    return _moves(run.run_id, segment, steady, geometry, quality)


def _noise(points: Floats) -> float:
    """Return the standard deviation of white noise on each axis, from second differences: motion hardly shows there."""
    return float(np.median(np.abs(np.diff(points, n=2, axis=0)))) / (0.6745 * math.sqrt(6.0))


def _stands_still(frames: Frames) -> bool:
    """Return whether nothing in these frames is farther from the start than noise explains."""
    points = np.column_stack([frames.x_m, frames.y_m])
    blocks = np.array([block.mean(axis=0) for block in np.array_split(points, 8)])
    farthest = float(np.max(np.hypot(*(blocks - blocks[0]).T)))
    return farthest < max(_STANDS_M, _STANDS_SIGMAS * _noise(points) / math.sqrt(len(points) / 8.0))


def _stands(run_id: str, segment: Segment, frames: Frames, quality: FrameQuality) -> RunMeasurement:
    heading, _ = _robust_mean_angle(frames.heading_rad)
    forward = math.cos(heading) * frames.x_m + math.sin(heading) * frames.y_m
    speed = robust_slope(frames.t_s, forward)
    return RunMeasurement(
        run_id=run_id,
        command=segment.command,
        speed_mps=speed,
        speed_stderr_mps=slope_stderr(frames.t_s, forward, speed),
        arc_rad=0.0,
        rms_m=float(np.std(forward)),
        begin_s=float(frames.t_s[0]),
        end_s=float(frames.t_s[-1]),
        frames_used=len(frames),
        quality=quality,
    )


def _moves(run_id: str, segment: Segment, frames: Frames, geometry: Geometry, quality: FrameQuality) -> RunMeasurement:
    points = np.column_stack([frames.x_m, frames.y_m])
    path = fit_path(frames.t_s, points, where=f"run {run_id}")
    length = float(np.ptp(path.along_m[path.used]))
    limit_m = max(_MAX_RMS_SHARE * length, _MAX_RMS_SIGMAS * _noise(points))
    if path.rms_m > limit_m:
        raise FitError(
            "the vehicle did not drive one arc",
            where=f"run {run_id}",
            value=f"{1e3 * path.rms_m:.1f} mm about a path of {1e3 * length:.0f} mm",
            limit=f"{1e3 * limit_m:.1f} mm: {_MAX_RMS_SHARE:.0%} of the path, or {_MAX_RMS_SIGMAS:g} times the noise",
            remedy="hold one command, on a level floor, in view of the cameras",
        )
    sideslip, sideslip_stderr = _robust_mean_angle((path.tangent_rad - frames.heading_rad)[path.used])
    speed = robust_slope(frames.t_s[path.used], path.along_m[path.used])
    curvature = path.curvature_per_m
    # Over a full turn a wrong radius is a wrong distance; over a short arc its angle compensates for it.
    share = min(1.0, path.arc_rad**2 / 12.0) * path.curvature_stderr_per_m / max(abs(curvature), 1e-9)
    speed_stderr = math.hypot(slope_stderr(frames.t_s[path.used], path.along_m[path.used], speed), speed * share)
    if math.cos(sideslip) < 0.0:  # it looks away from where it goes: it drives backward
        sideslip, speed, curvature = math.remainder(sideslip + math.pi, 2.0 * math.pi), -speed, -curvature
    front, rear = axle_angles_from_curvature(curvature, sideslip, geometry)
    front_stderr, rear_stderr = axle_angle_stderrs(
        curvature, path.curvature_stderr_per_m, sideslip, sideslip_stderr, geometry
    )
    return RunMeasurement(
        run_id=run_id,
        command=segment.command,
        front_rad=float(front),
        rear_rad=float(rear),
        speed_mps=speed,
        front_stderr_rad=front_stderr,
        rear_stderr_rad=rear_stderr,
        speed_stderr_mps=speed_stderr,
        curvature_per_m=curvature,
        curvature_stderr_per_m=path.curvature_stderr_per_m,
        sideslip_rad=sideslip,
        sideslip_stderr_rad=sideslip_stderr,
        arc_rad=path.arc_rad,
        rms_m=path.rms_m,
        begin_s=float(frames.t_s[0]),
        end_s=float(frames.t_s[-1]),
        frames_used=int(np.count_nonzero(path.used)),
        quality=quality,
    )


def _robust_mean_angle(angle_rad: Floats) -> tuple[float, float]:
    """Return the mean of angles in (−π, π] without those far off, and its standard error."""
    first = math.atan2(float(np.mean(np.sin(angle_rad))), float(np.mean(np.cos(angle_rad))))
    off = wrap_angle(angle_rad - first)
    off = off - np.median(off) if len(off) else off
    middle = float(np.median(wrap_angle(angle_rad - first)))
    near = off[np.abs(off) <= 5.0 * max(robust_std(off), 1e-12)]
    stderr = float(np.std(near)) / math.sqrt(len(near)) * correlation_factor(near)
    return math.remainder(first + middle + float(np.mean(near)), 2.0 * math.pi), stderr


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


def steady_part(run: Run, neutral: Command | None, *, turns: bool = False) -> tuple[Segment, Frames, FrameQuality]:
    """Return the longest stretch of one command in a run, its clean frames after settling, and the frames' quality.

    Raise `FitError` if too few frames are usable, or the command was not held long enough; see `driven_segment`.
    """
    where = f"run {run.run_id}"
    frames, quality = inspect_frames(run.frames)
    if len(frames) < MIN_FRAMES or not len(run.commands):
        raise FitError(
            "too few frames to measure",
            where=where,
            value=f"{len(frames)} of {quality.frames} usable",
            limit=f"at least {MIN_FRAMES}",
        )
    segment = driven_segment(run.commands, float(frames.t_s[-1]), neutral, turns=turns)
    return segment, steady_frames(frames, segment, where=where), quality


def driven_segment(commands: Commands, last_frame_s: float, neutral: Command | None, *, turns: bool = False) -> Segment:
    """Return the longest stretch of one command in which the vehicle was commanded to drive.

    The last row is the stop, and `neutral` (if None, its commands) says which rows stand still: steering
    is set before the vehicle drives. A run that never leaves neutral, as in the middle of the drive
    calibration, is taken for what it is: its longest stretch. With `turns` the front command moves a vehicle, too.
    """
    rows = np.column_stack([commands.drive, commands.front, commands.rear])
    changes = np.flatnonzero(np.any(np.diff(rows, axis=0) != 0.0, axis=1)) + 1
    starts = np.r_[0, changes].astype(np.int64)
    times = np.r_[commands.t_s[starts], max(last_frame_s, commands.t_s[-1])]
    stop = commands.at(len(commands) - 1) if neutral is None else neutral
    driven = commands.drive[starts] != stop.drive
    if turns:
        driven |= commands.front[starts] != stop.front
    # A stop is no measurement of standing still, unless nothing else was asked for.
    among = np.flatnonzero(driven) if driven.any() else np.arange(len(starts))
    longest = among[np.argmax(np.diff(times)[among])]
    return Segment(commands.at(int(starts[longest])), float(times[longest]), float(times[longest + 1]))


def steady_frames(frames: Frames, segment: Segment, *, where: str) -> Frames:
    """Return the clean frames of `segment` after speed and yaw rate have settled.

    Both are taken over 0.2 s. The level is the median over the second half of the segment; the vehicle has settled
    when it was last outside 2 % (or four standard deviations, if that is more) of the level in the first
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
    sd = robust_std(second - level)
    off = (np.abs(rate - level) > max(_TOLERANCE * abs(level), 4.0 * sd)) & (t_s < middle_s)
    return float(t_s[off][-1]) + _STRIDE_S / 2.0 if off.any() else -np.inf
