"""A differential vehicle of a few lines, driven by a joystick: independent of the model under test.

Left and right wheels have speeds of their own; the body is integrated in steps of 2 ms. What it hides is a field.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from agvbench.campaign import CampaignHeader
from agvbench.types import NO_TARGET, Commands, Frames, Run
from agvbench.vehicle.channels import Channels

HEADER = CampaignHeader(
    schema=3, name="differential", vehicle_name="turtle", front_axle_m=0.0, rear_axle_m=0.1,
    channels=Channels.alike("si"), mocap_rate_hz=50.0, prediction_horizon_s=2.0, prediction_stride_s=1.0,
    kinematics="differential",
)  # fmt: skip
_STEP_S, _COMMAND_S = 0.002, 0.1
_TRACK_M = 0.4


@dataclasses.dataclass(frozen=True)
class Differential:
    """The truth; times in s, lengths in m. ``right_wheel`` is the diameter of the right wheel over that of the left.

    A controller with integral action turns the vehicle against friction, which resists yaw rates below ``scrub_radps``.
    """

    speed_gain: float = 0.9
    yaw_gain: float = 0.7
    speed_lag_s: float = 0.0
    yaw_lag_s: float = 0.0
    yaw_acceleration: float = np.inf
    delay_s: float = 0.0
    further_speed_delay_s: float = 0.0
    camera_delay_s: float = 0.0
    right_wheel: float = 1.0
    marker_ahead_m: float = 0.1
    slip_by_speed: float = 0.0
    scrub_radps: float = 0.0
    integral_time_s: float = 1.0
    noise_m: float = 3e-4
    noise_rad: float = 8e-4
    frame_s: float = 0.02
    speed_held_s: float = 1.7


COARSE = Differential(noise_m=0.015, noise_rad=0.01, frame_s=0.1, speed_held_s=6.0)
"""Ten noisy poses a second, as those of a vehicle that locates itself; speeds are held for 6 s."""


def joystick(seconds: float, rng: np.random.Generator, truth: Differential) -> tuple[np.ndarray, np.ndarray]:
    """Return speed and yaw rate commands (n,), ten a second: forward, backward, and turns on the spot."""
    count = round(seconds / _COMMAND_S)

    def steps(size: float, every_s: float) -> np.ndarray:
        held = max(1, round(every_s / _COMMAND_S))
        return np.round(np.repeat(rng.uniform(-size, size, count // held + 1), held)[:count], 2)

    speed = steps(0.6, truth.speed_held_s)
    speed[(np.arange(count) // 60) % 3 == 2] = 0.0
    return speed, steps(1.2, 1.1)


def drive(truth: Differential, seconds: float, rng: np.random.Generator) -> tuple[Commands, Frames]:
    """Return commands and frames of one drive."""
    v_command, w_command = joystick(seconds, rng, truth)
    t = np.arange(0.0, seconds, _STEP_S)
    late_s = truth.delay_s + np.array([truth.further_speed_delay_s, 0.0])
    v_at, w_at = (np.clip(((t - s) / _COMMAND_S + 1e-9).astype(int), 0, len(v_command) - 1) for s in late_s)
    v = w = integral = 0.0
    x, y, heading = rng.uniform(-1.0, 1.0, 3)
    path = np.empty((len(t), 3))
    for k in range(len(t)):
        path[k] = x, y, heading
        v_aim, w_aim = truth.speed_gain * v_command[v_at[k]], truth.yaw_gain * w_command[w_at[k]]
        v += (v_aim - v) * (_STEP_S / truth.speed_lag_s if truth.speed_lag_s else 1.0)
        most = truth.yaw_acceleration * _STEP_S
        w += np.clip((w_aim - w) * (_STEP_S / truth.yaw_lag_s if truth.yaw_lag_s else 1.0), -most, most)
        turning = w
        if truth.scrub_radps:  # proportional and integral torque, less dry friction
            torque = w + integral
            turning = torque - np.clip(torque, -truth.scrub_radps, truth.scrub_radps)
            integral += (w - turning) * _STEP_S / truth.integral_time_s
        left, right = v - 0.5 * _TRACK_M * turning, (v + 0.5 * _TRACK_M * turning) * truth.right_wheel
        forward, yaw = 0.5 * (left + right), (right - left) / _TRACK_M
        yaw /= 1.0 + truth.slip_by_speed * forward * forward
        middle = heading + 0.5 * yaw * _STEP_S
        x, y = x + forward * np.cos(middle) * _STEP_S, y + forward * np.sin(middle) * _STEP_S
        heading += yaw * _STEP_S
    frame_s = np.arange(0.0, seconds, truth.frame_s)
    seen = np.clip(((frame_s - truth.camera_delay_s) / _STEP_S + 1e-9).astype(int), 0, len(t) - 1)
    pose = path[seen]
    pose[:, 0] += truth.marker_ahead_m * np.cos(path[seen, 2])
    pose[:, 1] += truth.marker_ahead_m * np.sin(path[seen, 2])
    pose += rng.normal(size=pose.shape) * [truth.noise_m, truth.noise_m, truth.noise_rad]
    nan, yes = np.full(len(frame_s), np.nan), np.ones(len(frame_s), dtype=bool)
    frames = Frames(frame_s, *pose.T, yes, np.arange(len(frame_s)), nan, nan)
    return Commands(_COMMAND_S * np.arange(len(v_command)), v_command, w_command, np.zeros(len(v_command))), frames


class Campaign:
    """Drives of one truth, in sessions; ``session_changes`` are what differs in the last of them."""

    header = HEADER

    def __init__(
        self, truth: Differential, *, seed: int = 0, sessions: int = 4, seconds: float = 60.0, **session_changes: float
    ) -> None:
        rng = np.random.default_rng([0xD1F, seed])
        self.runs = []
        for session in range(sessions):
            own = dataclasses.replace(truth, **session_changes) if session == sessions - 1 else truth
            commands, frames = drive(own, seconds, rng)
            run = Run(f"{session}-0", "free", "", "", 0, NO_TARGET, 3600.0 * session, "ok", "", commands, frames)
            self.runs.append(dataclasses.replace(run, session=f"day {session}"))

    def __iter__(self):
        return iter(self.runs)
