"""Forward speed and yaw rate of one run in which a vehicle settled to one command, turning on the spot included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.calibration.measurement.path import correlation_factor, robust_slope, slope_stderr
from agvbench.calibration.measurement.run_measurement import steady_part
from agvbench.types import Command, Floats, Frames, Run
from agvbench.vehicle.geometry import Geometry

_STANDS_M, _STANDS_RAD = 0.01, 0.02
_ROUNDS = 3
_OUTLYING = 4.0  # standard deviations


@dataclass(frozen=True)
class BodyVelocity:
    """What a run at one command says: velocity of the axle's middle along the heading, and yaw rate.

    Each with its standard error. ``frames_used`` of the steady part. A vehicle that stands still has exactly zero: what
    its frames drift is noise.
    """

    command: Command
    forward_mps: float
    forward_stderr_mps: float
    yaw_rate_radps: float
    yaw_rate_stderr_radps: float
    frames_used: int


def measure_body_velocity(run: Run, geometry: Geometry, *, neutral: Command) -> BodyVelocity:
    """Measure forward speed and yaw rate of a run in which one command was held.

    The yaw rate is the robust slope of the heading (`robust_slope`). The velocity in the vehicle frame is constant
    while the command is held, so that positions are linear in it: x(t) = x₀ + u ∫cos ψ dt − w ∫sin ψ dt, and y(t)
    likewise, with the measured heading ψ. Both are fitted by least squares without outliers, whether the vehicle
    drives straight, in an arc, or turns on the spot.

    Parameters
    ----------
    run
        Commands and frames; frames at rest before and after do no harm.
    geometry
        Of a differential vehicle.
    neutral
        Command at which the vehicle stands.

    Raises
    ------
    FitError
        If the run has no usable frames, or held no command long enough.
    """
    segment, steady, _ = steady_part(run, neutral, turns=geometry.is_differential)
    heading = np.unwrap(steady.heading_rad)
    yaw_rate = robust_slope(steady.t_s, heading)
    yaw_stderr = slope_stderr(steady.t_s, heading, yaw_rate)
    forward, forward_stderr = _forward(steady, heading)
    duration_s = float(np.ptp(steady.t_s))
    return BodyVelocity(
        segment.command,
        forward if abs(forward) * duration_s > _STANDS_M else 0.0,
        forward_stderr,
        yaw_rate if abs(yaw_rate) * duration_s > _STANDS_RAD else 0.0,
        yaw_stderr,
        len(steady),
    )


def _forward(frames: Frames, heading: Floats) -> tuple[float, float]:
    """Return the velocity along the heading [m/s] and its standard error."""
    cos, sin = _integral(frames.t_s, np.cos(heading)), _integral(frames.t_s, np.sin(heading))
    one, zero = np.ones(len(frames)), np.zeros(len(frames))
    design = np.vstack([np.column_stack([cos, -sin, one, zero]), np.column_stack([sin, cos, zero, one])])
    observed = np.concatenate([frames.x_m, frames.y_m])
    used = np.ones(len(observed), dtype=bool)
    for _ in range(_ROUNDS):
        solution, *_ = np.linalg.lstsq(design[used], observed[used], rcond=None)
        residual = observed - design @ solution
        sd = float(np.std(residual[used]))
        used = np.abs(residual) <= _OUTLYING * max(sd, 1e-9)
    covariance = np.linalg.pinv(design[used].T @ design[used]) * sd**2
    return float(solution[0]), float(np.sqrt(covariance[0, 0])) * correlation_factor(residual[used])


def _integral(t_s: Floats, values: Floats) -> Floats:
    """Return the integral from the first time to each, by the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t_s)
    return np.concatenate([[0.0], np.cumsum(steps)])
