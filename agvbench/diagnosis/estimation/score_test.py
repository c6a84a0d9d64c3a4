"""Score test: gain and estimate of one more effect, predicted to first order from some simulations without a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.bounded_step import bounded_step
from agvbench.diagnosis.estimation.cross_validation import by_group
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.likelihood import Terms, residual_of, ridge, terms_of
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.effects import effect_kinds
from agvbench.types import Floats

_NORMAL_95 = 1.96


@dataclass(frozen=True)
class OneStepEstimate:
    """One more effect beside a fit: ``estimate`` and ``stderr`` (q,) of its parameters.

    ``influence`` (P, q) is by how much the parameters of the fit change per unit of each, if they are refitted.
    """

    estimate: Floats
    stderr: Floats
    influence: Floats

    def sizes_from(self, nulls: Floats) -> tuple[Floats, Floats]:
        """Return the distances (q,) of the near and the far end of the 95 % intervals from the null values (q,)."""
        distance, half = np.abs(self.estimate - nulls), _NORMAL_95 * self.stderr
        return np.maximum(distance - half, 0.0), distance + half


def initial_parameters(fitted: Fit, larger: Predictor, start: Floats) -> Floats:
    """Return the parameters (P,) at which a fit of `larger` starts, with its last effect at `start` (q,).

    If all runs begin with both axles at neutral, or none is steered, the nodal values are converted for the added
    effect. Otherwise they are those of `fitted`.
    """
    values, maps = fitted.parameters, larger.maps.size
    name = larger.effects[-1]
    kind = next((kind for kind in larger.batch.kinds if kind.name == name), None) or effect_kinds()[name]
    if kind.needs_differential or (larger.readings.initial_states is None and not larger.readings.preset):
        values = np.r_[larger.maps.beside(values[:maps], kind, start), values[maps:]]
    return np.asarray(np.r_[values, start])


def first_order_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    """Return the predicted reduction of the loss by one more effect, to first order, its parameters near `start` (q,).

    `larger` has the effects of `fitted` and then the new one. It is linearised at `start`. The derivatives by the
    existing parameters are those of `fitted`, so that a few simulations replace a fit. What cannot be evaluated at
    `start` gains −∞.
    """
    try:
        return _first_order_gain(fitted, larger, start, bounds)
    except np.linalg.LinAlgError:
        return -math.inf


def _first_order_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    parameters = initial_parameters(fitted, larger, start)
    poses, slopes = larger.by_last(parameters, fitted.random_effects, len(start), fitted.linear.poses)
    seen = larger.readings.seen
    if not (np.isfinite(poses[seen]).all() and np.isfinite(slopes[seen]).all()):
        return -math.inf
    residual = residual_of(larger, poses)
    prior = larger.prior(parameters)
    if larger.readings.initial_states is None:
        gain = fitted.linearisation_point.predicted_gain(residual, slopes, start, bounds, prior)
        return gain + fitted.prior.loss - prior.loss
    terms = _terms(fitted, larger, residual, slopes)
    gradient = terms.gradient.sum(axis=0) + prior.gradient
    matrix = terms.information.total + ridge(larger) + prior.information
    move = bounded_step(matrix, gradient, parameters, bounds)
    saved = 2.0 * gradient @ move - move @ matrix @ move
    return float(fitted.total_loss - terms.loss.sum() - prior.loss + saved)


def one_step_estimate(
    fitted: Fit, larger: Predictor, start: Floats, free: NDArray[np.bool_], group: NDArray[np.int64]
) -> OneStepEstimate:
    """Return the estimate of the last effect's parameters, without a fit.

    The estimate is one Newton step from `start` (q,), with all other parameters refitted; parameters that are not
    `free` (q,) keep their start, and have a standard error of zero. A standard error is the larger of those of the
    likelihood and of the sandwich estimator with groups of runs (R,) as clusters (Liang and Zeger 1986).

    Raises
    ------
    numpy.linalg.LinAlgError
        If a derivative is not finite.
    """
    parameters = initial_parameters(fitted, larger, start)
    poses, slopes = larger.by_last(parameters, fitted.random_effects, len(start))
    if not np.isfinite(slopes[larger.readings.seen]).all():
        raise np.linalg.LinAlgError("the model cannot be evaluated")
    terms = _terms(fitted, larger, residual_of(larger, poses), slopes)
    known, prior = len(fitted.parameters), larger.prior(parameters)
    gradient = terms.gradient.sum(axis=0) + prior.gradient
    matrix = terms.information.total + ridge(larger) + prior.information
    at = np.flatnonzero(np.r_[np.ones(known, dtype=np.bool_), free])
    own = np.linalg.pinv(matrix[np.ix_(at, at)], hermitian=True)
    scores = by_group(terms.gradient, group)[:, at]
    robust = own @ (scores.T @ scores) @ own * len(scores) / max(len(scores) - 1, 1)
    estimate, stderr = start.astype(np.float64), np.zeros(len(start))
    estimate[free] += (own @ gradient[at])[known:]
    stderr[free] = np.sqrt(np.maximum(np.diagonal(own), np.diagonal(robust)))[known:]
    influence = np.zeros((known, len(start)))
    influence[:, free] = -np.linalg.lstsq(matrix[:known, :known], matrix[:known, at[known:]], rcond=1e-12)[0]
    return OneStepEstimate(estimate, stderr, influence)


def _terms(fitted: Fit, larger: Predictor, residual: Floats, slopes: Floats) -> Terms:
    """Return the likelihood of residuals (R, K, 3) with `slopes` (R, K, 3, q) beside the derivatives of `fitted`."""
    linear = fitted.linear.with_last(slopes, larger.parameter_names[len(fitted.linear.effects) :])
    return terms_of(larger, residual, linear, fitted.random_effects, fitted.variance_components)
