"""A run as metrics see it: what was recorded, the path that was planned, and the poses that were driven."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from agvbench.signals import medians
from agvbench.statistics.rest_poses import start_pose
from agvbench.statistics.run_errors import RunError, run_error
from agvbench.types import Floats, Frames, Pose, Run, kept_by_frames

if TYPE_CHECKING:
    from agvbench.metrics.path_matching import PathErrors

_JUMP_M = 0.1
_NEIGHBOURS = 5


@dataclass(frozen=True)
class MeasuredRun(Run):
    """A recorded run with the path that was planned.

    Parameters
    ----------
    planned
        The planned path in the start frame, shape (n, 4): t [s], x, y [m], heading [rad, unwrapped]; None where the
        trajectory is not known, or has changed since.
    """

    planned: Floats | None = None

    @classmethod
    def of(cls, run: Run, planned: Floats | None) -> MeasuredRun:
        """Return `run` with its planned path."""
        return cls(**vars(run), planned=planned)

    @cached_property
    def driven(self) -> Floats:
        """The driven poses in the start frame, from the first command on, shape (n, 4): t [s], x, y [m], heading [rad].

        Frames that are not tracked, or lie more than 0.1 m from the median of the five around them, are left out. The
        heading is unwrapped. The first row is at the start, at the first command.

        Raises
        ------
        FitError
            If the vehicle was not seen at rest before the first command.
        """
        start = start_pose(self).pose
        poses = smooth_poses(self.frames)
        poses = in_start_frame(poses[poses[:, 0] > 0.0], start)
        return np.concatenate([np.zeros((1, 4)), poses])

    @cached_property
    def error(self) -> RunError:
        """Where the run ended against its target; see `RunError`.

        Raises
        ------
        InputError
            If the run has no target.
        FitError
            If its start or end pose cannot be measured.
        """
        return run_error(self)

    @cached_property
    def tracking(self) -> PathErrors | None:
        """The driven poses against the planned path at the same progress; None without a planned path."""
        if self.planned is None:
            return None
        from agvbench.metrics.path_matching import track_path  # numba takes a third of a second to import

        return track_path(self.driven, self.planned)


def in_start_frame(poses: Floats, start: Pose) -> Floats:
    """Return poses (n, 4) of the floor frame in the frame of `start`, headings unwrapped from zero."""
    c, s = np.cos(start.heading_rad), np.sin(start.heading_rad)
    moved = poses.copy()
    moved[:, 1:3] = (poses[:, 1:3] - start[:2]) @ np.array([[c, -s], [s, c]])
    moved[:, 3] = np.unwrap(np.concatenate([[0.0], poses[:, 3] - start.heading_rad]))[1:]
    return moved


@kept_by_frames
def smooth_poses(frames: Frames) -> Floats:
    """Return every tracked pose in order of capture and without jumps, shape (n, 4): t [s], x, y [m], heading [rad].

    A pose that lies more than 0.1 m from the median of the five around it is a jump.
    """
    poses = np.column_stack([frames.t_s, frames.x_m, frames.y_m, frames.heading_rad])
    poses = poses[frames.tracked.astype(np.bool_) & np.isfinite(poses).all(axis=1)]
    poses = poses[np.unique(poses[:, 0], return_index=True)[1]]
    if len(poses) < _NEIGHBOURS:
        return np.asarray(poses)
    half = _NEIGHBOURS // 2
    padded = np.pad(poses[:, 1:3], ((half, half), (0, 0)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS, axis=0)
    away = np.hypot(*(poses[:, 1:3] - medians(windows)).T)
    return np.asarray(poses[away <= _JUMP_M])
