"""The motion state of a tracked vehicle from earlier frames alone: a Kalman filter with white-noise jerk.

Each coordinate has position, velocity and acceleration as its state, driven by jerk as white noise (Y. Bar-Shalom,
X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, section 6.2.3). Frames may
be irregular and have gaps. The standard deviation of a frame and the spectral density of the jerk are those of maximum
likelihood of the innovations, so that the filter suits any frame rate, camera and vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from agvbench.compiled import cached_njit
from agvbench.types import Floats

_MIN_NOISE = np.array([1e-4, 2e-4])
_MAX_FITTED_FRAMES = 20_000
_LOG_RATIO_BOUNDS = (-5.0, 45.0)
_DIFFUSE = 1e12
# Bandwidths: the least one [1/s], and the most as a share of the frame rate: the lag of a filter of three frames.
_LEAST_BANDWIDTH, _MOST_PER_INTERVAL = 0.1, 3.4
# Innovations before a coordinate has three frames depend on the diffuse initial state alone.
_INITIAL_FRAMES = 3


@dataclass(frozen=True)
class MotionStates:
    """Pose and velocity after each frame, from that frame and those before it.

    ``pose`` (n, 3) [m, m, rad] and ``velocity`` (n, 3) [m/s, m/s, rad/s] are in the floor frame, with the standard
    errors ``pose_stderr`` and ``velocity_stderr`` of the same shapes.
    """

    pose: Floats
    velocity: Floats
    pose_stderr: Floats
    velocity_stderr: Floats

    def longitudinal_speed(self) -> Floats:
        """Return the speed along the heading (n,) [m/s]."""
        cosine, sine = np.cos(self.pose[:, 2]), np.sin(self.pose[:, 2])
        return np.asarray(cosine * self.velocity[:, 0] + sine * self.velocity[:, 1])


@dataclass(frozen=True)
class MotionFilter:
    """The filter of one recording.

    ``noise`` (2,): standard deviation of a frame in position [m] and heading [rad]. ``jerk`` (2,): root of the spectral
    density of the jerk [m/s^2.5, rad/s^2.5].
    """

    noise: Floats
    jerk: Floats

    @classmethod
    def fitted(cls, tracks: Sequence[tuple[Floats, Floats]]) -> MotionFilter:
        """Return the filter of maximum likelihood for `tracks`: times (n,) and poses (n, 3), continuous headings.

        Without tracks it is that of a vehicle of 1 m/s^2.5 and a precise camera.
        """
        if not tracks:
            return cls(_MIN_NOISE, np.ones(2))
        share = sum(len(t_s) for t_s, _ in tracks) / _MAX_FITTED_FRAMES
        kept = [(t_s[: _kept(t_s, share)], motion[: _kept(t_s, share)]) for t_s, motion in tracks]
        position = _most_likely([(t_s, np.ascontiguousarray(m[:, k])) for t_s, m in kept for k in (0, 1)])
        heading = _most_likely([(t_s, np.ascontiguousarray(m[:, 2])) for t_s, m in kept])
        noise, jerk = np.array([position, heading]).T
        return cls(np.maximum(noise, _MIN_NOISE), jerk)

    def bandwidth(self, interval_s: float) -> float:
        """Return the bandwidth ω of the filter of positions [1/s] in steady state, at one frame every `interval_s`.

        It is that of the same filter in continuous time (`agvbench.model.simulation.filtered_speed`).
        """
        bandwidth = (self.jerk[0] ** 2 / (self.noise[0] ** 2 * interval_s)) ** (1.0 / 6.0)
        return float(np.clip(bandwidth, _LEAST_BANDWIDTH, _MOST_PER_INTERVAL / interval_s))

    def states(self, t_s: Floats, motion: Floats) -> MotionStates:
        """Return the states after each frame; `t_s` (n,) ascending, `motion` (n, 3) with continuous headings."""
        columns = []
        for k, kind in enumerate((0, 0, 1)):
            ratio = (self.jerk[kind] / self.noise[kind]) ** 2
            state, stderr, _ = _filter(t_s, np.ascontiguousarray(motion[:, k]) / self.noise[kind], ratio)
            columns.append(self.noise[kind] * np.stack([*state[:, :2].T, *stderr[:, :2].T]))
        pose, velocity, pose_stderr, velocity_stderr = np.stack(columns, axis=-1)
        return MotionStates(pose, velocity, pose_stderr, velocity_stderr)


def _kept(t_s: Floats, share: float) -> int:
    return len(t_s) if share <= 1.0 else int(np.ceil(len(t_s) / share))


def _most_likely(tracks: list[tuple[Floats, Floats]]) -> tuple[float, float]:
    """Return the standard deviation of a frame and the root of the jerk's spectral density, of one coordinate.

    The likelihood is concentrated: for each ratio of both the scale is known.
    """

    def totals(log_ratio: float) -> Floats:
        return np.asarray(sum(_filter(t_s, z, np.exp(log_ratio))[2] for t_s, z in tracks))

    def loss(log_ratio: float) -> float:
        log_variance, squares, count = totals(log_ratio)
        return float(log_variance + count * np.log(squares / count)) if count and squares > 0.0 else 0.0

    best = float(minimize_scalar(loss, bounds=_LOG_RATIO_BOUNDS, method="bounded", options={"xatol": 0.05}).x)
    _, squares, count = totals(best)
    noise = float(np.sqrt(squares / count)) if count else 0.0
    return noise, noise * float(np.exp(0.5 * best))


@cached_njit()
def _filter(t_s: Floats, z: Floats, ratio: float) -> tuple[Floats, Floats, Floats]:
    """Return states (n, 3) with standard errors (n, 3), and the sums of the likelihood (3,), for frames of unit noise.

    `ratio` is the spectral density of the jerk over the variance of a frame [1/s^5]. The sums are those of the
    logarithm of the innovations' variance, of their squares over it, and their count.
    """
    n = len(t_s)
    states, stderr, sums = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(3)
    x, v, a = z[0], 0.0, 0.0
    xx, xv, xa, vv, va, aa = 1.0, 0.0, 0.0, _DIFFUSE, 0.0, _DIFFUSE
    for k in range(n):
        if k > 0:
            d = t_s[k] - t_s[k - 1]
            h = 0.5 * d * d
            x, v = x + d * v + h * a, v + d * a
            # Covariance of the prediction, and of the jerk during the interval.
            xx += 2.0 * (d * xv + h * xa) + d * d * vv + 2.0 * d * h * va + h * h * aa + ratio * d**5 / 20.0
            xv += d * (xa + vv) + (h + d * d) * va + d * h * aa + ratio * d**4 / 8.0
            xa += d * va + h * aa + ratio * d**3 / 6.0
            vv += 2.0 * d * va + d * d * aa + ratio * d**3 / 3.0
            va += d * aa + ratio * h
            aa += ratio * d
            variance = xx + 1.0
            innovation = z[k] - x
            if k >= _INITIAL_FRAMES:
                sums[0] += np.log(variance)
                sums[1] += innovation * innovation / variance
                sums[2] += 1.0
            gain_x, gain_v, gain_a = xx / variance, xv / variance, xa / variance
            x, v, a = x + gain_x * innovation, v + gain_v * innovation, a + gain_a * innovation
            vv, va, aa = vv - gain_v * xv, va - gain_v * xa, aa - gain_a * xa
            xx, xv, xa = gain_x, gain_v, gain_a  # for unit noise the covariance with the position is the gain
        states[k] = x, v, a
        stderr[k] = np.sqrt(xx), np.sqrt(max(vv, 0.0)), np.sqrt(max(aa, 0.0))
    return states, stderr, sums
