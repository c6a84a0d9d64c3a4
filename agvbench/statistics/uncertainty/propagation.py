"""Propagation of systematic sources to mean end pose errors, by finite steps.

The mean end position error is a mean of distances. Where repeats lie on all sides of the target its derivative by a
common shift vanishes, although a large shift enlarges every distance. JCGM 100:2008 allows to evaluate the change of
the result numerically, for a step of one standard uncertainty (5.1.3, note 2). Here the step is `STEP` standard
uncertainties, up to the limits that the expanded uncertainty is about: distances are convex in a shift, so that
shorter steps would be too small there. Where a result is linear in a source, the step makes no difference.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.statistics.uncertainty.repeats import Repeats
from agvbench.types import Floats

STEP = 1.96
"""Of a source, in standard uncertainties: 95 % of a normal distribution."""
CLOCK = "clock_ms"
SOURCES = {
    "camera_position_mm": ("camera: position at start and end, per axis", "mm"),
    "camera_scale_ppm": ("camera: scale of lengths", "ppm"),
    "camera_heading_deg": ("camera: heading at start and end", "deg"),
    "marker_offset_mm": ("centroid of the markers on the vehicle, per axis", "mm"),
    "heading_alignment_deg": ("alignment of the markers' heading", "deg"),
    CLOCK: ("capture clock and latency", "ms"),
}
"""What a lab can state, by key of ``[uncertainty]``: in words, and the unit of the standard uncertainty."""


def position_contribution(repeats: Repeats, key: str, standard: float) -> float:
    """Return the standard uncertainty [mm] of the mean end position error that source `key` of `standard` causes."""
    steps = STEP * _shifts(repeats, key, standard)
    both = repeats.error + np.stack([steps, -steps])
    changes = np.hypot(both[..., 0], both[..., 1]).mean(axis=-1) - repeats.distance.mean()
    return math.hypot(*np.abs(changes).max(axis=0)) / STEP


def heading_contribution(repeats: Repeats, key: str, standard: float) -> float:
    """Return the standard uncertainty [deg] of the mean heading error that source `key` of `standard` causes."""
    if key == "camera_heading_deg":
        return math.sqrt(2.0) * standard  # at start and end
    if key == CLOCK:
        return 1e-3 * math.degrees(repeats.at_rest("turn_rate_radps")) * standard
    return 0.0  # an alignment cancels between start and end


def _shifts(repeats: Repeats, key: str, size: float) -> Floats:
    """Return how source `key` of this size moves end positions: shape (axes, n, 2) [mm], axes being independent."""
    match key:
        case "camera_position_mm":  # start and end err independently
            return _along_axes(math.sqrt(2.0) * size, len(repeats))
        case "camera_scale_ppm":
            return np.asarray(1e-6 * size * repeats.reached[np.newaxis])
        case "camera_heading_deg" | "heading_alignment_deg":
            return _rotated(repeats.reached, np.float64(-math.radians(size)))[np.newaxis] - repeats.reached
        case "marker_offset_mm":
            offsets = _along_axes(size, len(repeats))
            return np.asarray(_rotated(offsets, repeats.turned) - offsets)
        case _:
            return _along_axes(repeats.at_rest("speed_mps") * size, len(repeats))  # m/s are mm/ms


def _along_axes(size: float, n: int) -> Floats:
    return np.repeat(size * np.eye(2)[:, np.newaxis], n, axis=1)


def _rotated(points: Floats, angle_rad: Floats | np.float64) -> Floats:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def enlargement_by_noise(repeats: Repeats) -> float:
    """Return by how much noise of the camera enlarges the mean end position error [mm], at least two repeats.

    Noise adds its variance to the cloud of end positions, hence distances from a target inside the cloud grow. The
    estimate compares the cloud with itself after its scatter about the mean has been reduced to the variance without
    noise. NaN where the noise is not known.
    """
    mean = repeats.error.mean(axis=0)
    deviations = repeats.error - mean
    scatter = float(np.sum(deviations**2)) / (len(repeats) - 1)
    if not math.isfinite(repeats.noise_mm2):
        return math.nan
    share = min(1.0, repeats.noise_mm2 / scatter) if scatter > 0.0 else 0.0
    without = mean + math.sqrt(1.0 - share) * deviations
    return float(repeats.distance.mean() - np.hypot(*without.T).mean())
