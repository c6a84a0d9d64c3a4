"""The runs of a campaign for the diagnosis: from rest, or cut into windows; cleaned, sampled and grouped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import inspect_frames
from agvbench.campaign.campaign import session_starts
from agvbench.diagnosis.data.initial_pose import frame_noise, initial_pose, shift_commands_half_a_row, unwrapped_poses
from agvbench.diagnosis.data.logged import NO_LOGGED_COLUMNS, LoggedColumns, logged_columns
from agvbench.diagnosis.data.merged_commands import CommandMerging
from agvbench.diagnosis.data.session_clocks import ClockOffset
from agvbench.diagnosis.data.splits import group_runs, with_common_levels
from agvbench.diagnosis.data.windows import (
    Horizon,
    InitialStates,
    RecordedMotion,
    Window,
    blocks,
    by_recording,
    cut_windows,
    recording_of,
)
from agvbench.errors import FitError
from agvbench.model.priors import Prior
from agvbench.model.simulation.simulation import SimulatedRun
from agvbench.types import Command, Commands, Floats, Frames, Run

SAMPLES = 24
"""Poses per run, the same number for short and long runs, because the run is the unit of observation."""

BACK_IN_TIME = "frames go back in time"
"""Reason to exclude a run whose frames are out of order and form no path when sorted by time."""

_NEAR_S = 0.04
_LOW_SHARE, _HIGH_SHARE, _ROUGHNESS_RATIO = 0.05, 0.25, 3.0
_MIN_FRAMES = 20
_MIN_SAMPLES = SAMPLES // 2


@dataclass(frozen=True)
class Readings:
    """Runs that begin at rest, or windows of free driving; R of them, K samples each.

    ``t_s`` (R, K) and ``poses`` (R, K, 3) [m, m, rad] are those of single frames. The heading is continuous from the
    start pose on. Poses are NaN where there is no frame. ``start`` (R, 3) with ``start_stderr`` (R, 3) comes from the
    frames at rest. ``started_h`` (R,) [h] is the time since the session began. ``group`` (R,) is the same number for
    runs with the same commands, and for windows of one block. ``refused`` maps the id of each excluded run to the
    reason. ``initial_states`` are those of windows; None for runs from rest. ``preset`` is True if the axles had
    settled at each run's first steering command before it was given, and False if they were at neutral; windows begin
    with the axle angles of earlier commands if it is True, and with the measured yaw rate otherwise. ``priors`` are
    separate measurements of the effects' parameters, which belong to the evidence of every model. ``logged`` are the
    columns that the lab logged. ``clock_offsets`` are those of sessions of free driving. ``merging`` is that of the
    commands of windows.
    """

    runs: tuple[Run, ...]
    t_s: Floats
    poses: Floats
    start: Floats
    start_stderr: Floats
    started_h: Floats
    group: NDArray[np.int64]
    refused: dict[str, str]
    initial_states: InitialStates | None = None
    preset: bool = False
    priors: tuple[Prior, ...] = ()
    logged: LoggedColumns = NO_LOGGED_COLUMNS
    clock_offsets: Mapping[str, ClockOffset] = field(default_factory=dict)
    merging: CommandMerging | None = None

    def __len__(self) -> int:
        return len(self.runs)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which samples there are, (R, K)."""
        return np.isfinite(self.poses[:, :, 0])

    @property
    def session_group(self) -> NDArray[np.int64]:
        """The same number for runs with the same commands in the same session, (R,)."""
        session = np.unique([run.session or "" for run in self.runs], return_inverse=True)[1]
        return np.asarray(self.group * (int(session.max(initial=0)) + 1) + session)

    def select(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Readings:
        """Return the runs that a mask or an index array selects."""
        chosen = np.arange(len(self))[index]
        return Readings(
            tuple(self.runs[i] for i in chosen),
            self.t_s[chosen],
            self.poses[chosen],
            self.start[chosen],
            self.start_stderr[chosen],
            self.started_h[chosen],
            self.group[chosen],
            self.refused,
            None if self.initial_states is None else self.initial_states.select(chosen),
            self.preset,
            self.priors,
            self.logged.select(chosen),
            self.clock_offsets,
            self.merging,
        )

    def simulated(self) -> list[SimulatedRun]:
        """Return the runs for simulation, at the times of the samples."""
        starts = [None] * len(self) if self.initial_states is None else self.initial_states.t_s.tolist()
        return [
            SimulatedRun(self._commands(run, b), t, float(h), b, self._preset(run.commands), tuple(logged))
            for run, t, h, b, logged in zip(
                self.runs,
                self.t_s,
                self.started_h,
                starts,
                self.logged.standardised(len(self)).tolist(),
                strict=True,
            )
        ]

    def _commands(self, run: Run, begins_s: float | None) -> Commands:
        """Return the commands of a run; those of windows are merged."""
        if self.merging is None or begins_s is None:
            return run.commands
        return self.merging.merged(run.commands, begins_s)

    def _preset(self, commands: Commands) -> tuple[float, float] | None:
        from_rest = self.initial_states is None
        return (float(commands.front[0]), float(commands.rear[0])) if self.preset and from_rest else None

    @property
    def begins_s(self) -> Floats:
        """The time at which the prediction begins (R,) [s], on each run's clock."""
        return np.zeros(len(self)) if self.initial_states is None else self.initial_states.t_s


def read_runs(runs: Iterable[Run], neutral: Command | None = None, *, turns_on_the_spot: bool = False) -> Readings:
    """Clean, sample and group runs; ``refused`` lists the runs that cannot be used.

    If `neutral` is given, a vehicle counts as at rest while its drive command is neutral, and one that
    `turns_on_the_spot` while its front command is, too. This supplies the initial pose of runs without frames before
    their first command.
    """
    every = [shift_commands_half_a_row(run) for run in with_common_levels(list(runs))]
    began = session_starts(every)
    kept: list[Run] = []
    rows: list[tuple[Floats, Floats, Floats, Floats]] = []
    refused: dict[str, str] = {}
    for run in every:
        try:
            rows.append(_read(run, neutral, turns_on_the_spot=turns_on_the_spot))
        except FitError as error:
            refused[run.run_id] = str(error).removeprefix(f"{run.run_id}: ")
        else:
            kept.append(run)
    started_h = np.array([(run.started_s - began[run.session]) / 3600.0 for run in kept])
    t_s, poses, start, stderr = (np.array([row[i] for row in rows]) for i in range(4))
    logged = logged_columns(kept, np.column_stack([np.zeros(len(kept)), t_s]), started_h) if kept else NO_LOGGED_COLUMNS
    return Readings(tuple(kept), t_s, poses, start, stderr, started_h, group_runs(kept), refused, None, logged=logged)


def read_windows(
    runs: Iterable[Run], horizon: Horizon, neutral: Command, *, turns_on_the_spot: bool = False
) -> Readings:
    """Cut runs into windows; ``refused`` lists the runs without any window, with the reason."""
    every = list(with_common_levels(list(runs)))
    began = session_starts(every)
    refused = {run.run_id: run.status for run in every if not run.is_ok}
    windows: list[Window] = []
    for recording in by_recording(run for run in every if run.is_ok).values():
        recorded = RecordedMotion.of(recording)
        for run in recording:
            try:
                windows += cut_windows(run, horizon, neutral, recorded, turns_on_the_spot=turns_on_the_spot)
            except FitError as error:
                refused[run.run_id] = str(error).removeprefix(f"{run.run_id}: ")
    initial_states = InitialStates(
        np.array([w.t0_s for w in windows]),
        np.array([w.speed_mps for w in windows]),
        np.array([w.speed_stderr for w in windows]),
        np.array([w.recent_speed_mps for w in windows]),
        np.array([w.yaw_rate for w in windows]).reshape(-1, 2),
        np.array([w.constant_velocity for w in windows]).reshape(-1, 3),
        np.array([w.noise for w in windows]).reshape(-1, 2),
        np.array([w.bandwidth for w in windows]),
        np.array([recording_of(w.run) for w in windows], dtype=np.str_),
        np.array([w.run.session or "" for w in windows], dtype=np.str_),
    )
    started_h = np.array([(w.run.started_s - began[w.run.session]) / 3600.0 for w in windows])
    t_s, poses, start, stderr = (
        np.array([getattr(w, name) for w in windows]) for name in ("t_s", "poses", "start", "start_stderr")
    )
    group = blocks(windows, horizon)
    cut = tuple(w.run for w in windows)
    logged = _logged_of_windows(cut, initial_states.t_s, t_s, started_h, horizon) if cut else NO_LOGGED_COLUMNS
    merging = CommandMerging.of(every, neutral)
    return Readings(
        cut, t_s, poses, start, stderr, started_h, group, refused, initial_states, logged=logged, merging=merging
    )


def _logged_of_windows(
    runs: tuple[Run, ...], begins_s: Floats, t_s: Floats, started_h: Floats, horizon: Horizon
) -> LoggedColumns:
    """Return the logged columns of windows: what they were for as long before each window as it lasts."""
    before_s = begins_s[:, None] - np.linspace(0.0, horizon.horizon_s, SAMPLES)
    return logged_columns(runs, np.column_stack([begins_s, t_s]), started_h, before_s)


def _read(run: Run, neutral: Command | None, *, turns_on_the_spot: bool) -> tuple[Floats, Floats, Floats, Floats]:
    if not run.is_ok:
        raise FitError(run.status)
    frames = _in_order(run)
    if len(frames) < _MIN_FRAMES or not len(run.commands):
        raise FitError("too few frames", value=len(frames), limit=f"at least {_MIN_FRAMES}")
    if frames.t_s[-1] <= 0.0:
        raise FitError("was not seen after its first command")
    start, stderr = initial_pose(run, frames, neutral, turns_on_the_spot=turns_on_the_spot)
    t_s, poses = _sampled(frames, np.linspace(0.0, float(frames.t_s[-1]), SAMPLES + 1)[1:])
    if np.count_nonzero(np.isfinite(poses[:, 0])) < _MIN_SAMPLES:
        raise FitError("too much of the run was not seen")
    turn = np.round((_heading_near_start(frames) - start[2]) / (2.0 * np.pi)) * 2.0 * np.pi
    poses[:, 2] -= turn
    return t_s, poses, start, stderr


def _in_order(run: Run) -> Frames:
    """Return the usable frames, sorted by time if the table is not."""
    frames, quality = inspect_frames(run.frames)
    out_of_order = quality.bad_time + quality.late
    if quality.bad_time <= _LOW_SHARE * quality.frames and out_of_order <= _HIGH_SHARE * quality.frames:
        return frames
    ordered, ordered_quality = inspect_frames(run.frames.select(np.argsort(run.frames.t_s, kind="stable")))
    jumps = ordered_quality.jumps + ordered_quality.doubled
    if jumps <= _LOW_SHARE * ordered_quality.frames and _as_smooth(ordered, frames):
        return ordered
    if out_of_order + quality.jumps > _HIGH_SHARE * quality.frames:
        raise FitError(BACK_IN_TIME)
    return frames


def _as_smooth(ordered: Frames, arrived: Frames) -> bool:
    """Whether frames in order of time form a path as smooth as in order of arrival, and not two interleaved ones."""
    roughness = [float(frame_noise(unwrapped_poses(frames))[0]) for frames in (ordered, arrived)]
    return roughness[0] <= _ROUGHNESS_RATIO * roughness[1]


def _heading_near_start(frames: Frames) -> float:
    return float(np.unwrap(frames.heading_rad)[max(int(np.searchsorted(frames.t_s, 0.0, side="right")) - 1, 0)])


def _sampled(frames: Frames, t_s: Floats) -> tuple[Floats, Floats]:
    """Return times (K,) and poses (K, 3) of the frames nearest to `t_s` (K,); poses are NaN where none is near.

    Poses are single frames and not averages. Averaging smooths the path where a vehicle starts, stops and turns, which
    would mimic a lag.
    """
    nearest = np.clip(np.searchsorted(0.5 * (frames.t_s[1:] + frames.t_s[:-1]), t_s), 0, len(frames) - 1)
    poses = np.column_stack([frames.x_m, frames.y_m, np.unwrap(frames.heading_rad)])[nearest]
    near = np.abs(frames.t_s[nearest] - t_s) <= _NEAR_S
    poses[~near] = np.nan
    return np.where(near, frames.t_s[nearest], t_s), poses
