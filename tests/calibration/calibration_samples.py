"""An independent truth: a rigid body turned about the point where the wheels' normals meet."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from agvbench.types import NO_TARGET, RUN_OK, Commands, Frames, Run

FRONT_M, REAR_M = 0.181, 0.121
RATE_HZ = 120.0


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
    """A vehicle with static maps and first-order lags, integrated in steps of 1 ms."""

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
        front_map, rear_map, speed_map = self.maps
        state = [front_map(commands.front[0]), rear_map(commands.rear[0]), 0.0]
        pose, poses, times = (0.0, 0.0, 0.4), [], []
        dt, t, due = 1e-3, -rest_s, -rest_s
        while t < until_s:
            if t >= due - 1e-9:
                poses.append(pose)
                times.append(t)
                due += 1.0 / rate_hz
            row = max(int(np.searchsorted(commands.t_s, t + 1e-9, side="right")) - 1, 0)
            aims = front_map(commands.front[row]), rear_map(commands.rear[row]), speed_map(commands.drive[row])
            if t < 0:
                aims = (*aims[:2], 0.0)
            state = [s + (a - s) * (dt / lag) for s, a, lag in zip(state, aims, self.lags, strict=True)]
            pose = step(pose, state[0], state[1], state[2] * dt, **self.geometry)
            t += dt
        return frames_of(np.array(times), poses, rng, **self.noise)
