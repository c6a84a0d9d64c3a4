"""An independent truth: a rigid body turned about the point where the wheels' normals meet."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from agvbench.types import NO_TARGET, RUN_OK, Commands, Frames, Run

FRONT_M, REAR_M = 0.181, 0.121
RATE_HZ = 120.0
DT = 2e-3


def turning_point(front, rear, front_m=FRONT_M, rear_m=REAR_M):
    """Return where the wheels' normals meet, vehicle frame; None if they are parallel."""
    normals = np.array([[math.cos(front), math.sin(front)], [math.cos(rear), math.sin(rear)]])
    if abs(np.linalg.det(normals)) < 1e-7:
        return None
    # A wheel at (a, 0) rolling along (cos δ, sin δ): its normal is all p with (p − (a, 0)) · (cos δ, sin δ) = 0.
    return np.linalg.solve(normals, [front_m * math.cos(front), -rear_m * math.cos(rear)])


def step(pose, front, rear, way, front_m=FRONT_M, rear_m=REAR_M):
    """Return the pose after the marker centroid has moved `way` metres (backward negative) along its circle."""
    x, y, heading = pose
    centre = turning_point(front, rear, front_m, rear_m)
    if centre is None:
        return x + way * math.cos(heading + front), y + way * math.sin(heading + front), heading
    # Turn the whole body about the centre: forward is counter-clockwise about a centre on the left.
    turn = way / math.hypot(*centre) * (1.0 if centre[1] > 0 else -1.0)
    c, s = math.cos(heading), math.sin(heading)
    floor = np.array([x + c * centre[0] - s * centre[1], y + s * centre[0] + c * centre[1]])
    ct, st = np.cos(turn), np.sin(turn)
    dx, dy = x - floor[0], y - floor[1]
    return floor[0] + ct * dx - st * dy, floor[1] + st * dx + ct * dy, heading + turn


def steady_poses(front, rear, speed, t_s, pose=(0.3, -0.2, 0.7), **geometry):
    """Return exact poses (n, 3) at `t_s` of a vehicle that never does anything else."""
    way = speed * np.asarray(t_s, dtype=float)
    return np.column_stack(np.broadcast_arrays(*step(pose, front, rear, way, **geometry)))


def frames_of(t_s, poses, rng=None, noise_m=0.0, noise_rad=0.0):
    """Return frames of true poses with white noise."""
    n = len(t_s)
    seen = np.array(poses, dtype=float)
    if rng is not None:
        seen = seen + rng.standard_normal(seen.shape) * [noise_m, noise_m, noise_rad]
    heading = (seen[:, 2] + np.pi) % (2 * np.pi) - np.pi
    nan = np.full(n, np.nan)
    return Frames(np.array(t_s), seen[:, 0], seen[:, 1], heading, np.ones(n, bool), np.arange(n), nan, nan.copy())


def run_of(commands, frames, run_id="r", experiment="steering_front", **fields):
    """Return a run with what matters here."""
    defaults = {"trajectory": "", "condition": "", "repeat": 0, "target": NO_TARGET, "started_s": 0.0}
    return Run(run_id, experiment, **{**defaults, "status": RUN_OK, "firmware": "", **fields}, commands=commands,
               frames=frames)  # fmt: skip


def held(drive, front, rear, for_s=6.0, neutral=1500.0, presteer_s=0.5):
    """Return commands: steer, drive, stop."""
    t = np.array([0.0, presteer_s, presteer_s + for_s])
    return Commands(t, np.array([neutral, drive, neutral]), np.full(3, float(front)), np.full(3, float(rear)))


class Vehicle:
    """A vehicle with static maps and first-order lags, integrated in steps of 2 ms."""

    def __init__(
        self,
        front: Callable[[float], float],
        rear: Callable[[float], float],
        speed: Callable[[float], float],
        *,
        speed_lag_s: float = 0.1,
        steering_lag_s: float = 0.05,
        front_m: float = FRONT_M,
        rear_m: float = REAR_M,
        noise_m: float = 2e-4,
        noise_rad: float = 2e-3,
    ):
        self.maps = front, rear, speed
        self.lags = steering_lag_s, steering_lag_s, speed_lag_s
        self.geometry = {"front_m": front_m, "rear_m": rear_m}
        self.noise = {"noise_m": noise_m, "noise_rad": noise_rad}

    def frames(self, commands, rng, until_s, rest_s=0.3, rate_hz=RATE_HZ):
        """Return the frames of a drive, from `rest_s` before its first command until `until_s`."""
        t = np.arange(-rest_s, until_s, DT)
        row = np.maximum(np.searchsorted(commands.t_s, t + 1e-9, side="right") - 1, 0)
        columns = (commands.front, commands.rear, commands.drive)
        aims = [np.array([f(c) for c in column])[row] for f, column in zip(self.maps, columns, strict=True)]
        aims[2][t < 0] = 0.0
        front, rear, speed = (
            lagged(aim, lag, start)
            for aim, lag, start in zip(aims, self.lags, (aims[0][0], aims[1][0], 0.0), strict=True)
        )
        poses = integrate(front, rear, speed * DT, **self.geometry)
        seen = np.searchsorted(t, np.arange(-rest_s, until_s - DT, 1.0 / rate_hz))
        return frames_of(t[seen], poses[seen], rng, **self.noise)


def lagged(aim, lag_s, start):
    """Return what follows `aim` with a first-order lag."""
    out, state, share = np.empty(len(aim)), start, 1.0 - math.exp(-DT / lag_s)
    for k, target in enumerate(aim.tolist()):
        out[k] = state
        state += share * (target - state)
    return out


def integrate(front, rear, way, front_m, rear_m, heading=0.4):
    """Return poses (n, 3) of a body that turns about where its wheels' normals meet, step by step."""
    normals = np.stack([np.cos([front, rear]), np.sin([front, rear])], axis=-1).transpose(1, 0, 2)
    right = np.stack([front_m * np.cos(front), -rear_m * np.cos(rear)], axis=-1)
    bent = np.abs(np.linalg.det(normals)) > 1e-7
    centre = np.zeros_like(right)
    centre[bent] = np.linalg.solve(normals[bent], right[bent][..., None])[..., 0]
    turn = np.zeros(len(way))
    turn[bent] = way[bent] / np.hypot(*centre[bent].T) * np.sign(centre[bent, 1])
    # Turning the origin about the centre by an angle moves it by centre − R(angle) centre.
    c, s = np.cos(turn), np.sin(turn)
    ahead = np.where(bent, centre[:, 0] - c * centre[:, 0] + s * centre[:, 1], way * np.cos(front))
    left = np.where(bent, centre[:, 1] - s * centre[:, 0] - c * centre[:, 1], way * np.sin(front))
    before = heading + np.concatenate([[0.0], np.cumsum(turn)[:-1]])
    x = np.cumsum(np.cos(before) * ahead - np.sin(before) * left)
    y = np.cumsum(np.sin(before) * ahead + np.cos(before) * left)
    return np.column_stack([np.r_[0.0, x[:-1]], np.r_[0.0, y[:-1]], before])
