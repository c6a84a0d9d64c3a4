"""Variance components of measurements and runs: weights, priors, and how they are estimated.

Windows of free driving have no offsets but those of their start pose: what one window misses its neighbours miss, too,
so that an offset for each would explain a cause away. Their errors grow with time and have heavy tails, another day's
driving being many times as far off as this one's: the likelihood is Student's, of a window and not of its samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import Floats

EVIDENCE_POSES = 4.0
"""A run's samples count as this many independent poses: what a model misses at one time it misses at the next."""

_LEAST_M, _LEAST_RAD = 1e-4, 2e-4
_START_EXTRA_M = 2e-4
_LEAST_SCATTER = np.array([2e-4, 2e-4, 2e-4, 2e-4])
_TAIL = 4.0  # degrees of freedom of a window's errors


@dataclass(frozen=True)
class Scatter:
    """Standard deviations.

    Within a run ``position_m`` and ``heading_rad``; from run to run ``offsets`` (4,): start heading [rad], front and
    rear axle [rad], log of speed. ``growth`` (K,) or (1,): how large errors of each sample are beside those.
    """

    position_m: float
    heading_rad: float
    offsets: Floats
    growth: Floats = field(default_factory=lambda: np.ones(1))


def first_scatter() -> Scatter:
    """Return a generous scatter to start from."""
    return Scatter(0.05, 0.05, np.array([0.01, 0.01, 0.01, 0.02]))


def scatter_of_windows(readings: Readings) -> Scatter:
    """Return a scatter to start from: errors that grow with time, and hardly an offset."""
    ahead_s = np.nanmean(readings.t_s - readings.begins_s[:, None], axis=0)
    return Scatter(0.1, 0.1, _LEAST_SCATTER.copy(), ahead_s / ahead_s[-1])


def tempering(predictor: Predictor) -> tuple[Floats, Floats]:
    """Return what each run's samples count as, as a share of so many independent poses (R,), and how many (R,)."""
    count = predictor.readings.seen.sum(axis=1).astype(np.float64)
    evidence = EVIDENCE_POSES if predictor.readings.begins is None else 1.0 / predictor.batch.redundancy
    return np.minimum(1.0, evidence / np.maximum(count, 1.0)), count


def scale_of(scatter: Scatter) -> Floats:
    """Return the standard deviation of each sample's error, (K or 1, 3)."""
    return np.asarray(scatter.growth[:, None] * [scatter.position_m, scatter.position_m, scatter.heading_rad])


def student(predictor: Predictor, squares: Floats) -> tuple[Floats, Floats]:
    """Return each window's loss and weight by Student's law for three numbers, given its squared errors.

    The squares are those of a part of a window where windows tell the same again; so is the loss.
    """
    part = 1.0 / predictor.batch.redundancy
    return part * (_TAIL + 3.0) * np.log1p(squares / part / _TAIL), (_TAIL + 3.0) / (_TAIL + squares / part)


def weights(predictor: Predictor, scatter: Scatter) -> Floats:
    """Return what residuals are multiplied by (R, K, 3)."""
    temper, _ = tempering(predictor)
    return np.asarray(np.sqrt(temper)[:, None, None] * predictor.readings.seen[:, :, None] / scale_of(scatter))


def priors(predictor: Predictor, scatter: Scatter) -> Floats:
    """Return how far each run's offsets may be from none, (R, 6)."""
    start = np.hypot(predictor.readings.start_stderr, _START_EXTRA_M)
    out = np.empty((len(predictor.readings), 6))
    out[:, :2] = start[:, :2]
    out[:, 2] = np.hypot(start[:, 2], scatter.offsets[0])
    out[:, 3:] = scatter.offsets[1:]
    return out


def rescatter(
    predictor: Predictor, residual: Floats, offsets: Floats, inner_inverse: Floats, scatter: Scatter
) -> Scatter:
    """Return the scatter that residuals (R, K, 3), offsets (R, 6) and their covariances (R, 6, 6) show."""
    seen = predictor.readings.seen
    if predictor.readings.begins is not None:
        return _rescatter_windows(predictor, residual, scatter)
    count = float(seen.sum())
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * seen[..., None]) / (2.0 * count))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * seen) / count)
    variance = offsets[:, 2:] ** 2 + np.diagonal(inner_inverse, axis1=1, axis2=2)[:, 2:]
    return Scatter(
        max(float(position), _LEAST_M),
        max(float(heading), _LEAST_RAD),
        np.maximum(np.sqrt(variance.mean(axis=0)), _LEAST_SCATTER),
    )


def _rescatter_windows(predictor: Predictor, residual: Floats, scatter: Scatter) -> Scatter:
    seen = predictor.readings.seen
    temper, _ = tempering(predictor)
    e = residual * seen[..., None] / scale_of(scatter)
    _, trust = student(predictor, temper * np.sum(e * e, axis=(1, 2)))
    weight = seen * trust[:, None]
    total = np.maximum(seen.sum(axis=0), 1.0)
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * weight[..., None], axis=(0, 2)) / (2.0 * total))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * weight, axis=0) / total)
    # One growth for both, that of position, which is what is asked for in the end.
    growth = np.maximum(position, _LEAST_M) / max(float(position[-1]), _LEAST_M)
    return Scatter(
        max(float(position[-1]), _LEAST_M),
        max(float(np.sqrt(np.mean((heading / growth) ** 2))), _LEAST_RAD),
        scatter.offsets,
        growth,
    )
