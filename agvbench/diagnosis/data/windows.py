"""Windows of free driving, with the initial state of each prediction.

Runs are cut into windows of a `Horizon` if they do not begin at rest, or if the campaign requests it. The initial pose
and speed of a window are estimated from earlier frames only. Commands before the window determine the state of the
actuators at its beginning.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import inspect_frames
from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.data.initial_pose import frame_noise, starts_at_rest
from agvbench.model.simulation.loop import RECENT_SPEED_S
from agvbench.statistics.rest_poses import SPEED_LIMIT_MPS
from agvbench.types import Commands, Floats, Frames, Run

SUPPORT_S = 0.2
"""Duration of the frames before a window whose parabolas give its initial pose and speed [s]."""

SAMPLES = 8
"""Poses per window, evenly spaced; the last one at the horizon."""

HISTORY_S = 2.0
"""Duration of the commands before a window that are simulated for the state of its actuators [s]."""

CONSTANT_VELOCITY_S = 0.1
"""Duration before a window over which the constant-velocity baseline averages velocity and yaw rate [s]."""

_DEFAULT_HORIZON_S, _DEFAULT_STRIDE_S = 2.0, 1.0
_NEAR_S = 0.04
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
    its standard error. ``recent_speed_mps``: its weighted mean over the recent past. ``constant_velocity`` (W, 3):
    longitudinal and lateral velocity [m/s] and yaw rate [rad/s] over the last `CONSTANT_VELOCITY_S`. ``noise`` (W, 2):
    standard deviation of one frame in position [m] and heading [rad]. ``recording`` and ``session``: names.
    """

    t_s: Floats
    speed_mps: Floats
    speed_stderr: Floats
    recent_speed_mps: Floats
    constant_velocity: Floats
    noise: Floats
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
    constant_velocity: Floats
    noise: Floats


def horizon_of(header: HeaderLike, runs: Iterable[Run]) -> Horizon | None:
    """Return the horizon of the windows; None if the campaign declares none and most of its runs begin at rest."""
    if header.prediction_horizon_s is not None:
        return Horizon(header.prediction_horizon_s, header.prediction_stride_s or header.prediction_horizon_s)
    usable = [run for run in runs if run.is_ok and len(run.frames)]
    resting = sum(starts_at_rest(run, header.neutral) for run in usable)
    return Horizon() if usable and resting < 0.5 * len(usable) else None


def cut_windows(run: Run, horizon: Horizon, neutral: float) -> Iterator[Window]:
    """Yield the windows of `run` in which the vehicle drives and is tracked."""
    frames, _ = inspect_frames(run.frames)
    if len(frames) < _MIN_FRAMES or not len(run.commands):
        return
    t = frames.t_s
    motion = np.column_stack([frames.x_m, frames.y_m, np.unwrap(frames.heading_rad)])
    noise = frame_noise(motion)
    first = max(float(t[0]) + SUPPORT_S, 0.0 if run.frames.t_s[0] < 0.0 else SUPPORT_S)
    for begin_s in np.arange(first, float(t[-1]) - horizon.horizon_s + _NEAR_S, horizon.stride_s):
        last = int(np.searchsorted(t, begin_s + 1e-9, side="right"))
        state = _state(t[:last], motion[:last], noise)
        if state is None or begin_s - t[last - 1] > _NEAR_S:
            continue
        window = _window(run, horizon, neutral, t, motion, last, state, noise)
        if window is not None:
            yield window


@dataclass(frozen=True)
class _State:
    pose: Floats
    pose_stderr: Floats
    speed_mps: float
    speed_stderr: float
    recent_speed_mps: float
    constant_velocity: Floats


def _state(t: Floats, motion: Floats, noise: Floats) -> _State | None:
    """Return the state at the last frame; None if the frames before it have a gap or are too few."""
    own = t > t[-1] - SUPPORT_S if len(t) else np.empty(0, dtype=np.bool_)
    u, m = t[own] - t[-1] if len(t) else t, motion[own]
    if len(u) < _MIN_FRAMES or -u[0] < 0.7 * SUPPORT_S or np.max(np.diff(u)) > SUPPORT_S / 3.0:
        return None
    design = np.column_stack([np.ones_like(u), u, u * u])
    unscaled = np.linalg.inv(design.T @ design)
    value, slope, _ = unscaled @ design.T @ m
    value_scale, slope_scale = np.sqrt(unscaled[0, 0]), np.sqrt(unscaled[1, 1])
    c, s = np.cos(value[2]), np.sin(value[2])
    recent = u > -CONSTANT_VELOCITY_S
    recent[-3:] = True
    line = np.column_stack([np.ones(int(recent.sum())), u[recent]])
    vx, vy, yaw = np.linalg.lstsq(line, m[recent], rcond=None)[0][1]
    # The vehicle turns during the last 0.1 s: the mean velocity belongs to the heading in the middle.
    middle = value[2] + yaw * float(u[recent].mean())
    cm, sm = np.cos(middle), np.sin(middle)
    return _State(
        value,
        value_scale * noise[[0, 0, 1]],
        float(c * slope[0] + s * slope[1]),
        float(slope_scale * noise[0]),
        _recent_speed(t, motion),
        np.array([cm * vx + sm * vy, cm * vy - sm * vx, yaw]),
    )


def _recent_speed(t: Floats, motion: Floats) -> float:
    """Return the longitudinal speed, averaged with weights exp(−age / `RECENT_SPEED_S`)."""
    own = t > t[-1] - _RECENT_SPANS * RECENT_SPEED_S
    dt, step = np.diff(t[own]), np.diff(motion[own], axis=0)
    heading = motion[own][1:, 2] - 0.5 * step[:, 2]
    weight = np.exp((t[own][1:] - t[-1]) / RECENT_SPEED_S)
    longitudinal = np.cos(heading) * step[:, 0] + np.sin(heading) * step[:, 1]
    return float(np.sum(weight * longitudinal) / np.sum(weight * dt))


def _window(
    run: Run,
    horizon: Horizon,
    neutral: float,
    t: Floats,
    motion: Floats,
    last: int,
    state: _State,
    noise: Floats,
) -> Window | None:
    t0 = float(t[last - 1])
    sample_s = t0 + horizon.horizon_s * np.arange(1, SAMPLES + 1) / SAMPLES
    nearest = np.clip(np.searchsorted(0.5 * (t[1:] + t[:-1]), sample_s), 0, len(t) - 1)
    poses, near = motion[nearest].copy(), np.abs(t[nearest] - sample_s) <= _NEAR_S
    if not near[-1] or np.count_nonzero(near) < SAMPLES // 2:
        return None
    poses[~near] = np.nan
    commands = _commands_of_window(run, t0, t0 + horizon.horizon_s)
    if abs(state.speed_mps) < SPEED_LIMIT_MPS and np.all(commands.drive[commands.t_s > t0 - SUPPORT_S] == neutral):
        return None  # at rest, as commanded
    piece = replace(run, run_id=f"{run.run_id}@{t0:.2f}", commands=commands, frames=Frames.empty())
    return Window(
        piece,
        t0,
        state.pose,
        state.pose_stderr,
        np.where(near, t[nearest], sample_s),
        poses,
        state.speed_mps,
        state.speed_stderr,
        state.recent_speed_mps,
        state.constant_velocity,
        noise,
    )


def _commands_of_window(run: Run, t0: float, end_s: float) -> Commands:
    """Return the commands of a window and of its history.

    The first of them counts as given long before, unless the run began at rest within the history.
    """
    c = run.commands
    first = max(int(np.searchsorted(c.t_s, t0 - HISTORY_S, side="right")) - 1, 0)
    stop = max(int(np.searchsorted(c.t_s, end_s, side="left")), first + 1)
    t_s = c.t_s[first:stop].copy()
    if first or not np.any(run.frames.t_s < -_NEAR_S):
        t_s[0] = min(t_s[0], t0) - _HELD_S
    return Commands(t_s, c.drive[first:stop], c.front[first:stop], c.rear[first:stop])


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
