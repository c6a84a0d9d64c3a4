"""Variance components of measurements and runs: initial values, updates, and the weights and priors that follow.

The errors of windows of free driving grow with time and have heavy tails: on another day they may be many times as
large. The likelihood of a window is therefore Student's t, with the window and not the sample as unit. That of a run
is, too, where the model lacks a cause: a few runs then have errors that are many times as large, and would otherwise
determine the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import Floats

EVIDENCE_POSES = 4.0
"""Number of independent poses that a run's samples are worth: residuals within a run are strongly correlated."""

_MIN_M, _MIN_RAD = 1e-4, 2e-4
_START_EXTRA_M = 2e-4
_MIN_DEVIATION = np.array([2e-4, 2e-4, 2e-4, 2e-4])
_STUDENT_DOF = 4.0  # of the errors of windows
_STUDENT_DOF_OF_RUNS = 8.0


@dataclass(frozen=True)
class VarianceComponents:
    """Standard deviations.

    ``position_m`` and ``heading_rad`` are those of samples within a run. ``random_effects`` (4,) are those between
    runs: start heading [rad], front and rear axle [rad], logarithm of speed. ``growth`` (K,) or (1,) is the factor on
    the standard deviations of each sample.
    """

    position_m: float
    heading_rad: float
    random_effects: Floats
    growth: Floats = field(default_factory=lambda: np.ones(1))

    def change_to(self, other: VarianceComponents) -> float:
        """Return the largest relative change of a standard deviation."""
        own, theirs = (
            np.r_[v.position_m, v.heading_rad, v.random_effects, v.position_m * v.growth] for v in (self, other)
        )
        return float(np.max(np.abs(theirs / own - 1.0)))


def initial_variance_components() -> VarianceComponents:
    """Return large initial values."""
    return VarianceComponents(0.05, 0.05, np.array([0.01, 0.01, 0.01, 0.02]))


def window_variance_components(readings: Readings) -> VarianceComponents:
    """Return initial values for windows: errors that grow with time."""
    elapsed_s = np.nanmean(readings.t_s - readings.begins_s[:, None], axis=0)
    return VarianceComponents(0.1, 0.1, _MIN_DEVIATION.copy(), elapsed_s / elapsed_s[-1])


def tempering(predictor: Predictor) -> tuple[Floats, Floats]:
    """Return the weight of one sample of each run (R,), and each run's number of samples (R,)."""
    count = predictor.readings.seen.sum(axis=1).astype(np.float64)
    independent = (
        EVIDENCE_POSES if predictor.readings.initial_states is None else 1.0 / predictor.batch.autocorrelation_time
    )
    return np.minimum(1.0, independent / np.maximum(count, 1.0)), count


def scale_of(variance_components: VarianceComponents) -> Floats:
    """Return the standard deviation of each sample's error, (K or 1, 3)."""
    return np.asarray(
        variance_components.growth[:, None]
        * [variance_components.position_m, variance_components.position_m, variance_components.heading_rad]
    )


def student(predictor: Predictor, squares: Floats) -> tuple[Floats, Floats]:
    """Return the loss and the weight of each run or window (R,) under Student's t, given its squared errors (R,).

    Windows are in three dimensions. If they are correlated, each counts as the share 1/autocorrelation time of an
    independent window. Squared errors and losses are those of this share. Runs are in the dimensions of their
    independent poses. Without heavy tails, which `Batch` states, their errors are normal, and their losses the squared
    errors.
    """
    batch, part = predictor.batch, 1.0 / predictor.batch.autocorrelation_time
    freedom, dimensions = _STUDENT_DOF, 3.0
    if predictor.readings.initial_states is None:
        if not batch.has_heavy_tails:
            return squares, np.ones(len(squares))
        freedom, dimensions = _STUDENT_DOF_OF_RUNS, 3.0 * EVIDENCE_POSES
    return (
        part * (freedom + dimensions) * np.log1p(squares / part / freedom),
        (freedom + dimensions) / (freedom + squares / part),
    )


def weights(predictor: Predictor, variance_components: VarianceComponents) -> Floats:
    """Return the weights of the residuals (R, K, 3): the inverse of their standard deviation, times the tempering."""
    temper, _ = tempering(predictor)
    return np.asarray(
        np.sqrt(temper)[:, None, None] * predictor.readings.seen[:, :, None] / scale_of(variance_components)
    )


def priors(predictor: Predictor, variance_components: VarianceComponents) -> Floats:
    """Return the prior standard deviations of each run's q random effects, (R, q)."""
    start = np.hypot(predictor.readings.start_stderr, _START_EXTRA_M)
    out = np.empty((len(predictor.readings), len(predictor.random_effects)))
    out[:, :2] = start[:, :2]
    out[:, 2:] = variance_components.random_effects[: out.shape[1] - 2]
    out[:, 2] = np.hypot(start[:, 2], out[:, 2])
    return out


def update_variance_components(
    predictor: Predictor,
    residual: Floats,
    random_effects: Floats,
    inner_inverse: Floats,
    by_random_effects: Floats,
    variance_components: VarianceComponents,
) -> VarianceComponents:
    """Return the estimate from residuals (R, K, 3), random effects (R, q) and their covariances (R, q, q).

    The derivatives of the poses `by_random_effects` are (R, K, 3, q).
    """
    seen = predictor.readings.seen
    if predictor.readings.initial_states is not None:
        # The start pose is estimated from the window itself, and takes as much of its error (EM algorithm).
        taken = np.einsum("rkcm,rmn,rkcn->rkc", by_random_effects, inner_inverse, by_random_effects, optimize=True)
        return _update_window_variance_components(predictor, residual**2 + taken, variance_components)
    count = float(seen.sum())
    errors = residual * seen[..., None]
    robust = np.ones((len(seen), 1))
    if predictor.batch.has_heavy_tails:
        squares = np.sum((errors * weights(predictor, variance_components)) ** 2, axis=(1, 2))
        squares += np.sum((random_effects / priors(predictor, variance_components)) ** 2, axis=1)
        robust = student(predictor, squares)[1][:, None]
    position = np.sqrt(np.sum(robust[..., None] * errors[..., :2] ** 2) / (2.0 * count))
    heading = np.sqrt(np.sum(robust * errors[..., 2] ** 2) / count)
    variance = robust * random_effects[:, 2:] ** 2 + np.diagonal(inner_inverse, axis1=1, axis2=2)[:, 2:]
    return VarianceComponents(
        max(float(position), _MIN_M),
        max(float(heading), _MIN_RAD),
        np.maximum(np.sqrt(variance.mean(axis=0)), _MIN_DEVIATION),
    )


def _update_window_variance_components(
    predictor: Predictor, squares: Floats, variance_components: VarianceComponents
) -> VarianceComponents:
    """Return the estimate from the expected squares of the errors (R, K, 3)."""
    seen = predictor.readings.seen
    temper, _ = tempering(predictor)
    scaled = squares * seen[..., None] / scale_of(variance_components) ** 2
    _, robust_weight = student(predictor, temper * np.sum(scaled, axis=(1, 2)))
    weight = seen * robust_weight[:, None]
    total = np.maximum(seen.sum(axis=0), 1.0)
    position = np.sqrt(np.sum(squares[..., :2] * weight[..., None], axis=(0, 2)) / (2.0 * total))
    heading = np.sqrt(np.sum(squares[..., 2] * weight, axis=0) / total)
    # Position and heading share the growth of position, which is the quantity to be predicted.
    growth = np.maximum(position, _MIN_M) / max(float(position[-1]), _MIN_M)
    return VarianceComponents(
        max(float(position[-1]), _MIN_M),
        max(float(np.sqrt(np.mean((heading / growth) ** 2))), _MIN_RAD),
        variance_components.random_effects,
        growth,
    )
