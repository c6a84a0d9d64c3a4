"""Windows of free driving, with the initial state of each prediction.

Runs are cut into windows of a `Horizon` if they do not begin at rest, or if the campaign requests it. The initial pose
and speed of a window come from a `MotionFilter` of its recording, which uses earlier frames only. Commands before the
window determine the state of the actuators at its beginning.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import inspect_frames
from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.data.initial_pose import is_driven, starts_at_rest, unwrapped_poses
from agvbench.diagnosis.data.motion_filter import MotionFilter, MotionStates
from agvbench.errors import FitError
from agvbench.model.simulation.loop import RECENT_SPEED_S
from agvbench.statistics.rest_poses import SPEED_LIMIT_MPS
from agvbench.types import Command, Commands, Floats, Frames, Run

SUPPORT_S = 0.2
"""Least duration of the frames before a window [s]."""

SAMPLES = 8
"""Poses per window, evenly spaced; the last one at the horizon."""

HISTORY_S, DIFFERENTIAL_HISTORY_S = 2.0, 20.0
"""Duration of the commands before a window that are simulated for the state of its actuators [s].

The controllers of a differential vehicle remember longer than servos do: `turning_resistance`.
"""

CONSTANT_VELOCITY_S = 0.1
"""Duration before a window over which the constant-velocity baseline averages velocity and yaw rate [s]."""

_DEFAULT_HORIZON_S, _DEFAULT_STRIDE_S = 2.0, 1.0
# A frame is taken for a sample within this time, and at low frame rates within this share of most of their intervals.
_NEAR_S, _NEAR_INTERVALS, _USUAL_INTERVALS = 0.04, 0.6, 0.9
_LATCHED_M = 1e-3
_MAX_SPEED_STDERR = 0.25
# Standard error of a yaw rate that commands predict, as a share of the usual yaw rate.
_PREDICTED_YAW_STDERR = 0.5
_RECENT_SPANS = 4.0
_MIN_FRAMES = 6
_HELD_S = 1e3
_BLOCK_S = 10.0
_BLOCK_HORIZONS = 4.0


@dataclass(frozen=True)
class Horizon:
    """Duration of a prediction, and interval between the starts of successive predictions [s]."""

    horizon_s: float = _DEFAULT_HORIZON_S
    stride_s: float = _DEFAULT_STRIDE_S

    @property
    def block_s(self) -> float:
        """The duration of a block: a part of a recording that is treated as one independent observation [s]."""
        return max(_BLOCK_S, _BLOCK_HORIZONS * self.horizon_s)


@dataclass(frozen=True)
class InitialStates:
    """The initial states of W windows; arrays of shape (W,) unless stated otherwise.

    ``t_s``: time on the run's clock. ``speed_mps`` and ``speed_stderr``: longitudinal speed of the marker centroid and
    its standard error. ``recent_speed_mps``: its weighted mean over the recent past. ``yaw_rate`` (W, 2): yaw rate
    [rad/s], and its weight beside that of the commands before the window. ``constant_velocity`` (W, 3):
    longitudinal and lateral velocity [m/s] and yaw rate [rad/s] over the last `CONSTANT_VELOCITY_S`. ``noise`` (W, 2):
    standard deviation of one frame in position [m] and heading [rad]. ``bandwidth`` [1/s]: that of the motion filter of
    positions. ``recording`` and ``session``: names.
    """

    t_s: Floats
    speed_mps: Floats
    speed_stderr: Floats
    recent_speed_mps: Floats
    yaw_rate: Floats
    constant_velocity: Floats
    noise: Floats
    bandwidth: Floats
    recording: NDArray[np.str_]
    session: NDArray[np.str_]

    def select(self, chosen: NDArray[np.int64]) -> InitialStates:
        """Return the initial states of the `chosen` windows (indices)."""
        return InitialStates(*(getattr(self, f.name)[chosen] for f in fields(self)))


@dataclass(frozen=True)
class Window:
    """One window: a part of a ``run`` from ``t0_s`` on.

    ``start`` (3,) with ``start_stderr`` (3,) is the initial pose. ``t_s`` (K,) and ``poses`` (K, 3) are those of single
    frames, NaN where none is near. The other fields are those of `InitialStates`.
    """

    run: Run
    t0_s: float
    start: Floats
    start_stderr: Floats
    t_s: Floats
    poses: Floats
    speed_mps: float
    speed_stderr: float
    recent_speed_mps: float
    yaw_rate: Floats
    constant_velocity: Floats
    noise: Floats
    bandwidth: float


def horizon_of(header: HeaderLike, runs: Iterable[Run]) -> Horizon | None:
    """Return the horizon of the windows; None if the campaign declares none and most of its runs begin at rest."""
    if header.prediction_horizon_s is not None:
        return Horizon(header.prediction_horizon_s, header.prediction_stride_s or header.prediction_horizon_s)
    usable = [run for run in runs if run.is_ok and len(run.frames)]
    turns = header.geometry.is_differential
    resting = sum(starts_at_rest(run, header.neutral, turns_on_the_spot=turns) for run in usable)
    return Horizon() if usable and resting < 0.5 * len(usable) else None


@dataclass(frozen=True)
class RecordedMotion:
    """What the runs of one recording have in common: the motion ``filter`` and root mean squares of the motion."""

    filter: MotionFilter
    typical_speed_mps: float
    typical_yaw_rate_radps: float

    @classmethod
    def of(cls, runs: Iterable[Run]) -> RecordedMotion:
        """Return it from the usable frames of the `runs` of a recording."""
        tracks = [track for track in map(unwrapped_track, runs) if len(track[0]) >= _MIN_FRAMES]
        fitted = MotionFilter.fitted(tracks)
        states = [fitted.states(*track) for track in tracks]
        speed, yaw_rate = (
            _root_mean_square([values[_MIN_FRAMES - 1 :] for values in every])
            for every in ([s.longitudinal_speed() for s in states], [s.velocity[:, 2] for s in states])
        )
        return cls(fitted, max(speed, SPEED_LIMIT_MPS), yaw_rate)


def _root_mean_square(parts: list[Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else 0.0


def unwrapped_track(run: Run) -> tuple[Floats, Floats]:
    """Return times (n,) and poses (n, 3), with a continuous heading, of the usable frames of `run`.

    A frame that repeats the pose before it while the vehicle moves is left out: the tracker had no new one.
    """
    frames, _ = inspect_frames(run.frames)
    motion = unwrapped_poses(frames)
    fresh = np.r_[True, np.any(np.diff(motion, axis=0) != 0.0, axis=1)][: len(frames)]
    # Of a vehicle at rest every frame is kept: the next pose that differs is near.
    following = np.searchsorted(np.flatnonzero(fresh), np.arange(len(frames)), side="right")
    after = np.append(np.flatnonzero(fresh), len(frames) - 1)[following] if len(frames) else following
    moved = np.hypot(*(motion[after, :2] - motion[:, :2]).T) > _LATCHED_M
    kept = fresh | ~moved
    return frames.t_s[kept], motion[kept]


@dataclass(frozen=True)
class _Track:
    """The frames of a run, n of them, with the states of the motion filter."""

    t_s: Floats
    motion: Floats
    states: MotionStates
    recorded: RecordedMotion
    turns_on_the_spot: bool

    @cached_property
    def near_s(self) -> float:
        """The largest distance in time of the frame that is taken for a sample [s]."""
        return max(_NEAR_S, _NEAR_INTERVALS * float(np.quantile(np.diff(self.t_s), _USUAL_INTERVALS)))

    @cached_property
    def bandwidth(self) -> float:
        """The bandwidth of the motion filter of positions [1/s]."""
        return self.recorded.filter.bandwidth(float(np.median(np.diff(self.t_s))))

    @cached_property
    def speed(self) -> Floats:
        """The longitudinal speed after each frame (n,) [m/s]."""
        return self.states.longitudinal_speed()

    @cached_property
    def speed_stderr(self) -> Floats:
        """Its standard error (n,) [m/s]."""
        return np.asarray(np.hypot(*self.states.velocity_stderr[:, :2].T) / np.sqrt(2.0))

    @cached_property
    def speed_known(self) -> NDArray[np.bool_]:
        """Whether the speed is known well enough for a prediction (n,)."""
        return self.speed_stderr <= np.maximum(self.max_stderr_mps, _MAX_SPEED_STDERR * np.abs(self.speed))

    @cached_property
    def max_stderr_mps(self) -> float:
        """The largest standard error of an initial speed of zero [m/s]: a share of the recording's speeds."""
        return _MAX_SPEED_STDERR * self.recorded.typical_speed_mps

    @cached_property
    def yaw_rate(self) -> Floats:
        """The yaw rate after each frame [rad/s] and its weight (n, 2), as of a Kalman update.

        Before it, the commands predict the yaw rate to a share of the usual one. With steered axles that is the less,
        the slower the vehicle is.
        """
        typical, speed = self.recorded.typical_yaw_rate_radps, np.abs(self.speed) / self.recorded.typical_speed_mps
        usual = typical * (np.ones_like(speed) if self.turns_on_the_spot else np.minimum(speed, 1.0))
        predicted, measured = (_PREDICTED_YAW_STDERR * usual) ** 2, self.states.velocity_stderr[:, 2] ** 2
        return np.column_stack([self.states.velocity[:, 2], predicted / (predicted + measured)])


def cut_windows(
    run: Run, horizon: Horizon, neutral: Command, recorded: RecordedMotion, *, turns_on_the_spot: bool = False
) -> list[Window]:
    """Return the windows of `run` in which the vehicle drives and is tracked; `recorded` is that of its recording.

    A differential vehicle `turns_on_the_spot`, so that its front command moves it, too.

    Raises
    ------
    FitError
        If there is none, with the reason and its figure: few frames or commands, a low frame rate, a short run, an
        uncertain initial speed, or a vehicle at rest.
    """
    t_s, motion = unwrapped_track(run)
    _require_frames(run, t_s, horizon)
    fitted = recorded.filter
    track = _Track(t_s, motion, fitted.states(t_s, motion), recorded, turns_on_the_spot)
    first_s = max(float(t_s[0]) + SUPPORT_S, float(t_s[_MIN_FRAMES - 1]), _first_prediction_s(run))
    begins_s = np.arange(first_s, float(t_s[-1]) - horizon.horizon_s + track.near_s, horizon.stride_s)
    last = np.searchsorted(t_s, begins_s + 1e-9, side="right") - 1
    usable = last[track.speed_known[last] & (begins_s - t_s[last] <= track.near_s)]
    windows = [w for k in usable.tolist() if (w := _window(run, horizon, track, k)) is not None]
    windows = [w for w in windows if not _stands(w, neutral, turns_on_the_spot=turns_on_the_spot)]
    if not windows:
        _raise_no_window(run, horizon, track, first_s, last)
    return windows


def _first_prediction_s(run: Run) -> float:
    """Return the time of the first command; not before zero."""
    return max(0.0, float(run.commands.t_s[0]))


def _require_frames(run: Run, t_s: Floats, horizon: Horizon) -> None:
    if not len(run.commands):
        raise FitError("has no commands", where=run.run_id)
    if len(t_s) < _MIN_FRAMES:
        raise FitError("has too few usable frames", where=run.run_id, value=len(t_s), limit=f"at least {_MIN_FRAMES}")
    interval_s, most_s = float(np.median(np.diff(t_s))), horizon.horizon_s / SAMPLES
    if interval_s > most_s:
        raise FitError(
            "has too few frames per second",
            where=run.run_id,
            value=f"one every {interval_s:.3g} s",
            limit=f"one every {most_s:.3g} s to predict {horizon.horizon_s:g} s ahead",
            remedy="set a longer [prediction] horizon_s in campaign.toml",
        )


def _raise_no_window(run: Run, horizon: Horizon, track: _Track, first_s: float, last: NDArray[np.int64]) -> None:
    """Raise the error of a run without windows that could have begun at the frames `last`."""
    fastest = float(np.max(np.abs(track.speed[track.speed_known]), initial=0.0))
    if not len(last):
        raise FitError(
            "is too short",
            where=run.run_id,
            value=f"{track.t_s[-1] - track.t_s[0]:.2f} s of frames",
            limit=f"at least {first_s - track.t_s[0] + horizon.horizon_s:.2f} s",
            remedy="record for longer, or predict less far ahead ([prediction] horizon_s in campaign.toml)",
        )
    if not track.speed_known[last].any():
        raise FitError(
            "has no certain initial speed",
            where=run.run_id,
            value=f"standard error {np.min(track.speed_stderr[last]):.2g} m/s",
            limit=f"{track.max_stderr_mps:.2g} m/s, or {_MAX_SPEED_STDERR:.0%} of the speed",
            remedy="record poses more often",
        )
    if fastest < SPEED_LIMIT_MPS:
        limit = f"faster than {SPEED_LIMIT_MPS:g} m/s"
        raise FitError("has no window in motion", where=run.run_id, value=f"{fastest:.2g} m/s at most", limit=limit)
    raise FitError(
        f"was not tracked {horizon.horizon_s:g} s after any initial state, or stood still where it was",
        where=run.run_id,
        value=f"longest gap {np.max(np.diff(track.t_s)):.2f} s",
        limit=f"a frame within {track.near_s:.2f} s of each sample",
    )


def _constant_velocity(t: Floats, motion: Floats) -> Floats:
    """Return longitudinal and lateral velocity and yaw rate (3,) at the last frame, by lines over the last 0.1 s."""
    recent = t > t[-1] - CONSTANT_VELOCITY_S
    recent[-3:] = True
    u, last = t[recent] - t[-1], motion[recent]
    line = np.column_stack([np.ones(len(u)), u])
    (_, _, heading), (vx, vy, yaw) = np.linalg.lstsq(line, last, rcond=None)[0]
    # The vehicle turns during the last 0.1 s: the mean velocity belongs to the heading in the middle.
    middle = heading + yaw * float(u.mean())
    c, s = np.cos(middle), np.sin(middle)
    return np.array([c * vx + s * vy, c * vy - s * vx, yaw])


def _recent_speed(t: Floats, motion: Floats) -> float:
    """Return the longitudinal speed, averaged with weights exp(−age / `RECENT_SPEED_S`)."""
    own = t > t[-1] - _RECENT_SPANS * RECENT_SPEED_S
    own[-2:] = True
    dt, step = np.diff(t[own]), np.diff(motion[own], axis=0)
    heading = motion[own][1:, 2] - 0.5 * step[:, 2]
    weight = np.exp((t[own][1:] - t[-1]) / RECENT_SPEED_S)
    longitudinal = np.cos(heading) * step[:, 0] + np.sin(heading) * step[:, 1]
    return float(np.sum(weight * longitudinal) / np.sum(weight * dt))


def _stands(window: Window, neutral: Command, *, turns_on_the_spot: bool) -> bool:
    """Return whether the vehicle stands at the beginning of a window, and is commanded to."""
    c = window.run.commands
    recent = c.t_s > window.t0_s - SUPPORT_S
    moved = np.any(is_driven(c, neutral, turns_on_the_spot=turns_on_the_spot)[recent])
    return bool(abs(window.speed_mps) < SPEED_LIMIT_MPS and not moved)


def _window(run: Run, horizon: Horizon, track: _Track, last: int) -> Window | None:
    """Return the window that begins at the frame `last`; None if its end is not seen."""
    t, t0 = track.t_s, float(track.t_s[last])
    sample_s = t0 + horizon.horizon_s * np.arange(1, SAMPLES + 1) / SAMPLES
    nearest = np.clip(np.searchsorted(0.5 * (t[1:] + t[:-1]), sample_s), 0, len(t) - 1)
    poses, near = track.motion[nearest].copy(), np.abs(t[nearest] - sample_s) <= track.near_s
    if not near[-1] or np.count_nonzero(near) < SAMPLES // 2:
        return None
    poses[~near] = np.nan
    history_s = DIFFERENTIAL_HISTORY_S if track.turns_on_the_spot else HISTORY_S
    commands = _commands_between(run, t0, t0 - history_s, t0 + horizon.horizon_s)
    recent = slice(None, last + 1)
    return Window(
        replace(run, run_id=f"{run.run_id}@{t0:.2f}", commands=commands, frames=Frames.empty()),
        t0,
        track.states.pose[last],
        track.states.pose_stderr[last],
        np.where(near, t[nearest], sample_s),
        poses,
        float(track.speed[last]),
        float(track.speed_stderr[last]),
        _recent_speed(t[recent], track.motion[recent]),
        track.yaw_rate[last],
        _constant_velocity(t[recent], track.motion[recent]),
        track.recorded.filter.noise,
        track.bandwidth,
    )


def _commands_between(run: Run, t0: float, begin_s: float, end_s: float) -> Commands:
    """Return the commands of a window that begins at `t0`, and of its history from `begin_s`.

    The first of them counts as given long before, unless the run began at rest within the history.
    """
    c = run.commands
    first = max(int(np.searchsorted(c.t_s, begin_s, side="right")) - 1, 0)
    stop = max(int(np.searchsorted(c.t_s, end_s, side="left")), first + 1)
    t_s = c.t_s[first:stop].copy()
    if first or not np.any(run.frames.t_s < -_NEAR_S):
        t_s[0] = min(t_s[0], t0) - _HELD_S
    return Commands(t_s, c.drive[first:stop], c.front[first:stop], c.rear[first:stop])


def by_recording(runs: Iterable[Run]) -> dict[str, list[Run]]:
    """Return the runs of each recording, by its name."""
    found: dict[str, list[Run]] = {}
    for run in runs:
        found.setdefault(recording_of(run), []).append(run)
    return found


def recording_of(run: Run) -> str:
    """Return the name of the recording that contains `run`, or the run's own id."""
    source = run.extra.get("source")
    return str(source) if source else run.run_id.rpartition("@")[0] or run.run_id


def blocks(windows: list[Window], horizon: Horizon) -> NDArray[np.int64]:
    """Return the block number of each window, (W,): a block is a part of one run of about `Horizon.block_s`."""
    names: dict[tuple[str, int], int] = {}
    ends: dict[str, float] = {}
    for w in windows:
        ends[w.run.run_id.rpartition("@")[0]] = w.t0_s
    out = []
    for w in windows:
        run_id = w.run.run_id.rpartition("@")[0]
        # Blocks of a run have equal length, so that none consists of a single window at its end.
        count = max(1, round(ends[run_id] / horizon.block_s))
        block = min(int(w.t0_s / (ends[run_id] + 1e-9) * count), count - 1)
        out.append(names.setdefault((run_id, block), len(names)))
    return np.array(out, dtype=np.int64)
