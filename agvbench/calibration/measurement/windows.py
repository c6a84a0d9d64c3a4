"""Speed, yaw rate and commands in short windows of a drive whose commands keep changing."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from agvbench.calibration.measurement.frames import clean_frames
from agvbench.types import Commands, Floats, Run
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import axle_angles

WINDOW_S = 0.25
_MIN_FRAMES = 6


@dataclass(frozen=True)
class Windows:
    """Windows of one run, arrays of shape (n,).

    ``t_s`` of the middle; ``forward_mps`` of the marker centroid in the vehicle frame;
    ``acceleration_mps2`` of the forward speed; ``front_rad``, ``rear_rad`` the axle angles that this motion implies.
    """

    t_s: Floats
    forward_mps: Floats
    acceleration_mps2: Floats
    front_rad: Floats
    rear_rad: Floats

    def __len__(self) -> int:
        return len(self.t_s)

    def select(self, mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Windows:
        """Return the windows that `mask` chooses."""
        return Windows(*(getattr(self, f.name)[mask] for f in fields(self)))


def measured_windows(run: Run, geometry: Geometry) -> Windows:
    """Cut the clean frames of a run into windows of `WINDOW_S`, each overlapping half of the next.

    In each a parabola is fitted to x, y and heading over time; its slope in the middle is the velocity. Windows with
    few frames or a hole are skipped.
    """
    frames = clean_frames(run.frames)
    t, rows = frames.t_s, []
    motion = np.column_stack([frames.x_m, frames.y_m, np.unwrap(frames.heading_rad)])
    starts = np.arange(t[0], t[-1] - WINDOW_S, WINDOW_S / 2.0) if len(t) else np.empty(0)
    for first, last in zip(np.searchsorted(t, starts), np.searchsorted(t, starts + WINDOW_S), strict=True):
        if last - first < _MIN_FRAMES or np.max(np.diff(t[first:last])) > WINDOW_S / 3.0:
            continue
        middle = 0.5 * (t[first] + t[last - 1])
        u = t[first:last] - middle
        solution, *_ = np.linalg.lstsq(np.column_stack([np.ones_like(u), u, u * u]), motion[first:last], rcond=None)
        rows.append((middle, *solution.ravel()))
    table = np.array(rows).reshape(-1, 10)
    middle, (heading, vx, vy, yaw), (ax, ay) = table[:, 0], table[:, [3, 4, 5, 6]].T, 2.0 * table[:, [7, 8]].T
    c, s = np.cos(heading), np.sin(heading)
    forward, left = c * vx + s * vy, c * vy - s * vx
    front, rear = axle_angles(forward, left, yaw, geometry)
    acceleration = c * ax + s * ay + yaw * left  # of the forward component, whose axis turns
    return Windows(middle, forward, acceleration, front, rear)


def held_command(commands: Commands, role: str, t_s: Floats) -> Floats:
    """Return the command of `role` that holds at each time; NaN before the first."""
    index = np.searchsorted(commands.t_s, t_s + 1e-9, side="right") - 1
    values: Floats = getattr(commands, role)
    return np.where(index >= 0, values[np.maximum(index, 0)], np.nan)


def command_spread(commands: Commands, role: str, from_s: Floats, to_s: Floats) -> Floats:
    """Return by how much the command of `role` varies between the times; NaN where it is not known throughout."""
    values: Floats = getattr(commands, role)
    first = np.searchsorted(commands.t_s, from_s + 1e-9, side="right") - 1
    last = np.searchsorted(commands.t_s, to_s + 1e-9, side="right")
    return np.array([np.ptp(values[a:b]) if 0 <= a < b else np.nan for a, b in zip(first, last, strict=True)])
