"""Score test: the predicted gain of a larger model, to first order, from some simulations in place of a fit."""

from __future__ import annotations

import numpy as np

from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.likelihood import residual_of, ridge, terms_of
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.effects import effect_kinds
from agvbench.types import Floats


def initial_parameters(fitted: Fit, larger: Predictor, start: Floats) -> Floats:
    """Return the parameters (P,) at which a fit of `larger` starts, with its last effect at `start` (q,).

    If all runs begin with both axles at neutral, the nodal values are converted for the added effect. Otherwise they
    are those of `fitted`.
    """
    values, maps = fitted.parameters, larger.maps.size
    if larger.readings.initial_states is None and not larger.readings.preset:
        name = larger.effects[-1]
        kind = next((kind for kind in larger.batch.kinds if kind.name == name), None) or effect_kinds()[name]
        values = np.r_[larger.maps.beside(values[:maps], kind, start), values[maps:]]
    return np.asarray(np.r_[values, start])


def first_order_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    """Return the predicted reduction of the loss by one more effect, to first order, its parameters near `start` (q,).

    `larger` has the effects of `fitted` and then the new one. It is linearised at `start`. The derivatives by the
    existing parameters are those of `fitted`, so that a few simulations replace a fit.
    """
    parameters = initial_parameters(fitted, larger, start)
    poses, slopes = larger.by_last(parameters, fitted.random_effects, len(start))
    residual = residual_of(larger, poses)
    prior = larger.prior(parameters)
    if larger.readings.initial_states is None:
        gain = fitted.linearisation_point.predicted_gain(residual, slopes, start, bounds, prior)
        return gain + fitted.prior.loss - prior.loss
    terms = terms_of(
        larger, residual, fitted.linear.with_last(slopes), fitted.random_effects, fitted.variance_components
    )
    gradient = terms.gradient.sum(axis=0) + prior.gradient
    matrix = terms.information.total + ridge(larger) + prior.information
    move = np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0]
    # Parameters beyond a bound are set to it, and the others are solved for again.
    known = len(fitted.parameters)
    clipped = np.clip(start + move[known:], bounds[:, 0], bounds[:, 1])
    if np.any(clipped != start + move[known:]):
        fixed = np.r_[np.zeros(known), clipped - start]
        rest = np.linalg.lstsq(matrix[:known, :known], (gradient - matrix @ fixed)[:known], rcond=1e-12)[0]
        move = np.r_[rest, clipped - start]
    saved = 2.0 * gradient @ move - move @ matrix @ move
    return float(fitted.total_loss - terms.loss.sum() - prior.loss + saved)
