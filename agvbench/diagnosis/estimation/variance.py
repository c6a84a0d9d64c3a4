"""Variance components of measurements and runs: weights, priors, and how they are estimated.

Windows of free driving have no random effects but those of their start pose: residuals of neighbours are correlated,
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
"""A run's samples count as this many independent poses: successive residuals are correlated."""

_LEAST_M, _LEAST_RAD = 1e-4, 2e-4
_START_EXTRA_M = 2e-4
_LEAST_DEVIATION = np.array([2e-4, 2e-4, 2e-4, 2e-4])
_TAIL = 4.0  # degrees of freedom of a window's errors


@dataclass(frozen=True)
class VarianceComponents:
    """Standard deviations.

    Within a run ``position_m`` and ``heading_rad``; from run to run ``random_effects`` (4,): start heading [rad],
    front and rear axle [rad], log of speed. ``growth`` (K,) or (1,): how large errors of each sample are beside those.
    """

    position_m: float
    heading_rad: float
    random_effects: Floats
    growth: Floats = field(default_factory=lambda: np.ones(1))


def initial_variance_components() -> VarianceComponents:
    """Return generous variance components to start from."""
    return VarianceComponents(0.05, 0.05, np.array([0.01, 0.01, 0.01, 0.02]))


def window_variance_components(readings: Readings) -> VarianceComponents:
    """Return variance components to start from: errors that grow with time, and hardly an offset."""
    ahead_s = np.nanmean(readings.t_s - readings.begins_s[:, None], axis=0)
    return VarianceComponents(0.1, 0.1, _LEAST_DEVIATION.copy(), ahead_s / ahead_s[-1])


def tempering(predictor: Predictor) -> tuple[Floats, Floats]:
    """Return what each run's samples count as, as a share of so many independent poses (R,), and how many (R,)."""
    count = predictor.readings.seen.sum(axis=1).astype(np.float64)
    evidence = (
        EVIDENCE_POSES if predictor.readings.initial_states is None else 1.0 / predictor.batch.autocorrelation_time
    )
    return np.minimum(1.0, evidence / np.maximum(count, 1.0)), count


def scale_of(variance_components: VarianceComponents) -> Floats:
    """Return the standard deviation of each sample's error, (K or 1, 3)."""
    return np.asarray(
        variance_components.growth[:, None]
        * [variance_components.position_m, variance_components.position_m, variance_components.heading_rad]
    )


def student(predictor: Predictor, squares: Floats) -> tuple[Floats, Floats]:
    """Return each window's loss and weight by Student's law for three numbers, given its squared errors.

    The squares are those of a part of a window where windows are correlated; so is the loss.
    """
    part = 1.0 / predictor.batch.autocorrelation_time
    return part * (_TAIL + 3.0) * np.log1p(squares / part / _TAIL), (_TAIL + 3.0) / (_TAIL + squares / part)


def weights(predictor: Predictor, variance_components: VarianceComponents) -> Floats:
    """Return what residuals are multiplied by (R, K, 3)."""
    temper, _ = tempering(predictor)
    return np.asarray(
        np.sqrt(temper)[:, None, None] * predictor.readings.seen[:, :, None] / scale_of(variance_components)
    )


def priors(predictor: Predictor, variance_components: VarianceComponents) -> Floats:
    """Return how far each run's offsets may be from none, (R, 6)."""
    start = np.hypot(predictor.readings.start_stderr, _START_EXTRA_M)
    out = np.empty((len(predictor.readings), 6))
    out[:, :2] = start[:, :2]
    out[:, 2] = np.hypot(start[:, 2], variance_components.random_effects[0])
    out[:, 3:] = variance_components.random_effects[1:]
    return out


def update_variance_components(
    predictor: Predictor,
    residual: Floats,
    random_effects: Floats,
    inner_inverse: Floats,
    variance_components: VarianceComponents,
) -> VarianceComponents:
    """Estimate the components from residuals (R, K, 3), random effects (R, 6) and their covariances (R, 6, 6)."""
    seen = predictor.readings.seen
    if predictor.readings.initial_states is not None:
        return _update_window_variance_components(predictor, residual, variance_components)
    count = float(seen.sum())
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * seen[..., None]) / (2.0 * count))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * seen) / count)
    variance = random_effects[:, 2:] ** 2 + np.diagonal(inner_inverse, axis1=1, axis2=2)[:, 2:]
    return VarianceComponents(
        max(float(position), _LEAST_M),
        max(float(heading), _LEAST_RAD),
        np.maximum(np.sqrt(variance.mean(axis=0)), _LEAST_DEVIATION),
    )


def _update_window_variance_components(
    predictor: Predictor, residual: Floats, variance_components: VarianceComponents
) -> VarianceComponents:
    seen = predictor.readings.seen
    temper, _ = tempering(predictor)
    e = residual * seen[..., None] / scale_of(variance_components)
    _, trust = student(predictor, temper * np.sum(e * e, axis=(1, 2)))
    weight = seen * trust[:, None]
    total = np.maximum(seen.sum(axis=0), 1.0)
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * weight[..., None], axis=(0, 2)) / (2.0 * total))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * weight, axis=0) / total)
    # One growth for both, that of position, which is what is asked for in the end.
    growth = np.maximum(position, _LEAST_M) / max(float(position[-1]), _LEAST_M)
    return VarianceComponents(
        max(float(position[-1]), _LEAST_M),
        max(float(np.sqrt(np.mean((heading / growth) ** 2))), _LEAST_RAD),
        variance_components.random_effects,
        growth,
    )
