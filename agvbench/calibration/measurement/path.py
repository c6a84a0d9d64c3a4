"""The path of a steady drive: a circle or a straight line, and where on it each frame was."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.measurement import _circle_kernel as kernel
from agvbench.errors import FitError
from agvbench.signals import robust_std
from agvbench.types import Floats

_OUTLIER_SIGMAS = 5.0
_BLOCKS = 12


@dataclass(frozen=True)
class Path:
    """A circle in the form that holds for straight lines, too, driven in the direction of growing time.

    ``curvature_per_m`` (left of the direction of travel positive) with ``curvature_stderr_per_m``;
    ``along_m`` (n,) arc length at each frame, ``tangent_rad`` (n,) direction of travel there, ``used`` (n,) which
    frames the fit was made from (the others lie far off it); ``rms_m`` of the distances; ``arc_rad`` turned through.
    """

    curvature_per_m: float
    curvature_stderr_per_m: float
    along_m: Floats
    tangent_rad: Floats
    used: NDArray[np.bool_]
    rms_m: float
    arc_rad: float


def fit_path(t_s: Floats, points: Floats, *, where: str) -> Path:
    """Fit a circle or line to `points` (n, 2) [m] seen at `t_s` (n,), by least distances without the outliers.

    Raise `FitError` if the points determine neither.
    """
    used = np.ones(len(points), dtype=np.bool_)
    for _ in range(4):
        row = kernel.fit_batch(np.ascontiguousarray(points[used]), np.array([0, np.count_nonzero(used)]), False)[0]
        if not math.isfinite(row[kernel.CURVATURE]):
            raise FitError("the path is neither an arc nor a line", where=where, value=f"{len(points)} frames")
        along, distance = _coordinates(points, row)
        sd = robust_std(distance)
        keep = np.abs(distance) <= _OUTLIER_SIGMAS * max(sd, 1e-9)
        if np.array_equal(keep, used):
            break
        used = keep
    curvature, direction = float(row[kernel.CURVATURE]), float(row[kernel.DIRECTION])
    if robust_slope(t_s[used], along[used]) < 0.0:
        curvature, direction, along = -curvature, direction + math.pi, -along
    return Path(
        curvature_per_m=curvature,
        curvature_stderr_per_m=float(row[kernel.SE_CURVATURE]) * correlation_factor(distance[used]),
        along_m=along,
        tangent_rad=direction + curvature * along,
        used=used,
        rms_m=float(row[kernel.RMS]),
        arc_rad=abs(curvature) * float(np.ptp(along[used])),
    )


def _coordinates(points: Floats, row: Floats) -> tuple[Floats, Floats]:
    """Return arc length from the circle's reference point and distance to the left of the circle."""
    cos, sin = math.cos(row[kernel.DIRECTION]), math.sin(row[kernel.DIRECTION])
    dx, dy = points[:, 0] - row[kernel.POINT_X], points[:, 1] - row[kernel.POINT_Y]
    a, b, curvature = cos * dx + sin * dy, cos * dy - sin * dx, float(row[kernel.CURVATURE])
    rho = np.hypot(curvature * a, 1.0 - curvature * b)
    distance = (2.0 * b - curvature * (a * a + b * b)) / (1.0 + rho)
    if abs(curvature) * float(np.max(np.abs(a))) < 1e-9:
        return a, distance
    return np.unwrap(np.arctan2(curvature * a, 1.0 - curvature * b)) / curvature, distance


def robust_slope(t_s: Floats, values: Floats) -> float:
    """Return the slope of `values` over time: the median over pairs of frames half the time apart.

    This is the thesis' median of ds/dt (eq. 6.7, with the division by time that its text forgets) with a long
    baseline. From frame to frame at 120 Hz, 0.5 mm of noise is a fifth of the way driven at 0.3 m/s, and since a
    length is never negative it adds up instead of cancelling.
    """
    half = len(t_s) // 2
    dt = t_s[half:] - t_s[: len(t_s) - half]
    return float(np.median((values[half:] - values[: len(values) - half])[dt > 0.0] / dt[dt > 0.0]))


def slope_stderr(t_s: Floats, values: Floats, slope: float) -> float:
    """Return the standard error of `robust_slope`, from the noise about the line and its correlation in time."""
    residual = values - slope * t_s
    residual = residual - np.median(residual)
    sd = robust_std(residual)
    spread = float(np.sqrt(np.sum((t_s - t_s.mean()) ** 2)))
    return 1.3 * sd / spread * correlation_factor(residual)  # a median of pairs has 1.3 times the error of a line


def correlation_factor(residual: Floats) -> float:
    """Return by how much errors that neighbours share widen a standard error: block means against independence."""
    size = len(residual) // _BLOCKS
    if size < 2:
        return 1.0
    blocks = residual[: size * _BLOCKS].reshape(_BLOCKS, size).mean(axis=1)
    sd = float(np.std(residual))
    return max(1.0, float(np.std(blocks, ddof=1)) * math.sqrt(size) / sd) if sd > 0.0 else 1.0
