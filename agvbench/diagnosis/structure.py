"""What the remaining residual depends on, whatever the cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.grouping import folds
from agvbench.diagnosis.reading import Readings
from agvbench.statistics.multiplicity import holm
from agvbench.types import Floats

FEATURES = ("speed", "sideways", "turning")
ALPHA = 1e-3
"""A dependence is significant below this, after Holm's correction for all that were looked at."""

LEAST_SHARE = 0.02
_KNOTS = 6
_STILL_M = 0.01
_PERIODS_M = np.geomspace(0.1, 1.0, 25)


@dataclass(frozen=True)
class Dependence:
    """A ``covariate`` that the residual depends on, through ``feature``.

    ``p_value`` after correction; ``share`` of the residual's variance that it predicts in runs left out.
    """

    covariate: str
    feature: str
    p_value: float
    share: float


@dataclass(frozen=True)
class Rates:
    """The residual per metre driven, between successive samples.

    ``run`` (n,) its run; ``value`` (n, 3): share of the distance that is missed along and to the left, and turn missed
    [rad/m]; ``weight`` (n,) metres; ``covariates`` by name (n,).
    """

    run: NDArray[np.int64]
    value: Floats
    weight: Floats
    covariates: dict[str, Floats]


def residual_rates(readings: Readings, poses: Floats) -> Rates:
    """Return how fast measured and predicted motion part, per metre, with what it may depend on.

    Each step of the measurement is compared in the vehicle's own frame at its beginning with the same step of the
    prediction: what went wrong before does not enter.
    """
    measured = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    predicted = np.concatenate([readings.start[:, None], poses], axis=1)
    t_s = np.column_stack([readings.begins_s, readings.t_s])
    steps_m, steps_p = _body_steps(measured), _body_steps(predicted)
    length = np.hypot(steps_p[..., 0], steps_p[..., 1])
    use = np.isfinite(steps_m).all(axis=-1) & (length > _STILL_M)
    run = np.nonzero(use)[0]
    size = length[use]
    direction = np.sign(steps_p[..., 0])[use]
    value = (steps_m - steps_p)[use] / size[:, None]
    value[:, 0] *= direction
    middle = 0.5 * (measured[:, 1:] + measured[:, :-1])[use]
    duration = np.diff(t_s, axis=1)[use]
    driven = (np.cumsum(np.where(use, length, 0.0), axis=1) - 0.5 * length)[use]
    covariates = {
        "x_m": middle[:, 0],
        "y_m": middle[:, 1],
        "heading_rad": np.mod(middle[:, 2], 2.0 * np.pi),
        "time_in_run_s": 0.5 * (t_s[:, 1:] + t_s[:, :-1])[use],
        "campaign_time_h": readings.started_h[run],
        "speed_mps": size / duration,
        "direction": direction,
        "curvature_per_m": direction * steps_p[..., 2][use] / size,
        "sideslip": direction * steps_p[..., 1][use] / size,
        "distance_m": driven,
    }
    return Rates(run, value, size, covariates)


def _body_steps(poses: Floats) -> Floats:
    """Return successive steps (R, K, 3) in the frame half way between the headings at their ends."""
    step = np.diff(poses, axis=1)
    heading = 0.5 * (poses[:, 1:, 2] + poses[:, :-1, 2])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack(
        [cos * step[..., 0] + sin * step[..., 1], cos * step[..., 1] - sin * step[..., 0], step[..., 2]], -1
    )


def dependences(rates: Rates, group: NDArray[np.int64], seed: int) -> list[Dependence]:
    """Return what the residual significantly depends on, the largest share first.

    For each feature and covariate: least squares on a smooth curve, its Wald statistic with the run as unit (errors
    within a run may be correlated as they like), and the share of variance predicted in groups of runs left out.
    Distance enters modulo a period, the best of several, each of them counted as a try.
    """
    fold = folds(group, 5, seed)
    found: list[Dependence] = []
    tried: list[float] = []
    for name, covariate in rates.covariates.items():
        bases = [_basis(covariate, name)] if name != "distance_m" else [_waves(covariate, p) for p in _PERIODS_M]
        bases = [basis for basis in bases if basis.shape[1]]
        for k, feature in enumerate(FEATURES):
            p_values = [_wald(basis, rates.value[:, k], rates.weight, rates.run) for basis in bases]
            if not bases:
                continue
            best = int(np.argmin(p_values))
            p_value = min(1.0, p_values[best] * len(bases))
            share = _share(bases[best], rates.value[:, k], rates.weight, fold[rates.run])
            label = name if name != "distance_m" else "distance_modulo_period_m"
            found.append(Dependence(label, feature, p_value, share))
            tried.append(p_value)
    corrected = holm(tried)
    significant = [
        Dependence(d.covariate, d.feature, p, d.share)
        for d, p in zip(found, corrected, strict=True)
        if p < ALPHA and d.share > LEAST_SHARE
    ]
    return sorted(significant, key=lambda d: -d.share)


def _basis(covariate: Floats, name: str) -> Floats:
    """Return a smooth curve's basis (n, q) without a constant: sines for an angle, else hats on quantiles."""
    if name == "heading_rad":
        return np.column_stack([np.cos(covariate), np.sin(covariate), np.cos(2 * covariate), np.sin(2 * covariate)])
    knots = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, _KNOTS)))
    # Knots that nearly coincide would make curves out of noise.
    if len(knots) > 1:
        apart = np.r_[True, np.diff(knots) > 1e-3 * (knots[-1] - knots[0])]
        knots = knots[apart]
    if len(knots) < 2:
        return np.empty((len(covariate), 0))
    hats = np.column_stack([np.interp(covariate, knots, row) for row in np.eye(len(knots))])
    return np.asarray(hats[:, 1:])


def _waves(distance: Floats, period: float) -> Floats:
    angle = 2.0 * np.pi * distance / period
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _centred(basis: Floats, weight: Floats) -> Floats:
    return np.asarray(basis - np.average(basis, axis=0, weights=weight))


def _wald(basis: Floats, value: Floats, weight: Floats, run: NDArray[np.int64]) -> float:
    from scipy import stats

    design = _centred(basis, weight)
    centred = value - np.average(value, weights=weight)
    matrix = design.T @ (design * weight[:, None])
    coefficient = np.linalg.lstsq(matrix, design.T @ (weight * centred), rcond=1e-10)[0]
    rest = centred - design @ coefficient
    runs = int(run.max()) + 1
    scores = np.zeros((runs, design.shape[1]))
    np.add.at(scores, run, design * (weight * rest)[:, None])
    present = len(np.unique(run))
    meat = scores.T @ scores * present / max(present - design.shape[1] - 1, 1)
    pull = matrix @ coefficient
    q = design.shape[1]
    statistic = float(pull @ np.linalg.pinv(meat, hermitian=True) @ pull) / q
    return float(stats.f.sf(statistic, q, max(present - q - 1, 1)))


def _share(basis: Floats, value: Floats, weight: Floats, fold: NDArray[np.int64]) -> float:
    """Return the share of the weighted variance that the curve predicts in the folds left out."""
    full = np.column_stack([np.ones(len(value)), basis])
    error = total = 0.0
    for k in np.unique(fold):
        out = fold == k
        w = weight[~out]
        matrix = full[~out].T @ (full[~out] * w[:, None])
        coefficient = np.linalg.lstsq(matrix, full[~out].T @ (w * value[~out]), rcond=1e-8)[0]
        mean = np.average(value[~out], weights=w)
        error += float(np.sum(weight[out] * (value[out] - full[out] @ coefficient) ** 2))
        total += float(np.sum(weight[out] * (value[out] - mean) ** 2))
    return 1.0 - error / total if total > 0.0 else 0.0
