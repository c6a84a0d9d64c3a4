"""Score test: the predicted gain of a larger model, to first order, from some simulations in place of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.likelihood import WEAK, inner_inverse, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.variance import priors, weights
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.effects import effect_kinds
from agvbench.types import Floats

if TYPE_CHECKING:
    from agvbench.diagnosis.estimation.fit import Fit


@dataclass(frozen=True)
class LinearisationPoint:
    """A fitted model about which larger models are linearised, with the random effects projected out.

    ``weight`` (R, K, 3): weights of the residuals; ``a`` (R, 3K, 6): derivatives by the random effects; ``inverse``
    (R, 6, 6): the inverse of their information; ``prior_gradient`` (R, 6): gradient of their prior; ``own`` (R, m):
    indices of each run's active parameters; ``j`` (R, 3K, m): projected derivatives by these; ``covariance`` (P, P) of
    the parameters; ``pull`` (P,): gradient of the prior of the random effects by the parameters; ``residual`` (R, 3K),
    weighted.
    """

    weight: Floats
    a: Floats
    inverse: Floats
    prior_gradient: Floats
    own: NDArray[np.int64]
    j: Floats
    covariance: Floats
    pull: Floats
    residual: Floats

    @classmethod
    def of(cls, fitted: Fit) -> LinearisationPoint:
        """Return the linearisation point of a fit."""
        predictor, variance_components, linear = fitted.predictor, fitted.variance_components, fitted.linear
        weight = weights(predictor, variance_components)
        residual = (fitted.residual * weight).reshape(len(weight), -1)
        a = (linear.by_random_effects * weight[..., None]).reshape(*residual.shape, -1)
        j = (linear.by_own * weight[..., None]).reshape(*residual.shape, -1)
        prior = priors(predictor, variance_components)
        inverse = inner_inverse(a, prior)[1]
        mixed = inverse @ (a.transpose(0, 2, 1) @ j)
        prior_gradient = fitted.random_effects / prior**2
        matrix = fitted.information.total + ridge(predictor)
        pull = np.zeros(len(matrix))
        np.add.at(pull, linear.own, np.einsum("rij,ri->rj", mixed, prior_gradient))
        covariance = np.asarray(np.linalg.inv(matrix))
        return cls(weight, a, inverse, prior_gradient, linear.own, j - a @ mixed, covariance, pull, residual)

    @cached_property
    def squares(self) -> float:
        """The weighted sum of squares of the fit's residuals."""
        return self._squares(self.residual)

    def _squares(self, e: Floats) -> float:
        """Return the weighted sum of squares of residuals `e` (R, 3K), minimised over the random effects."""
        pull = (self.a.transpose(0, 2, 1) @ e[..., None])[..., 0] - self.prior_gradient
        return float(np.sum(e * e) - np.sum(pull * (self.inverse @ pull[..., None])[..., 0]))

    def predicted_gain(self, residual: Floats, slopes: Floats, start: Floats, bounds: Floats) -> float:
        """Return the predicted reduction of the loss, to first order, from the larger model's linearisation.

        `residual` (R, K, 3) is that of the larger model at `start` (q,). `slopes` (R, K, 3, q) are the derivatives by
        its new parameters, and `bounds` (q, 2) their bounds.
        """
        e = (residual * self.weight).reshape(len(residual), -1)
        new = (slopes * self.weight[..., None]).reshape(*e.shape, -1)
        projected = new - self.a @ (self.inverse @ (self.a.transpose(0, 2, 1) @ new))
        # The prior of the random effects contributes to the gradient, too.
        pull = np.einsum("rnq,rn->q", projected, e) + np.einsum("rnq,rn->q", new, self._prior_change)
        products = self._products(np.concatenate([e[..., None], new], axis=-1))
        old_pull, shared = products[:, 0] + self.pull, products[:, 1:]
        own = np.einsum("rnp,rnq->pq", new, projected) + WEAK * np.eye(len(start))
        # The existing parameters are eliminated (Schur complement): the new parameters remain.
        along = self.covariance @ shared
        matrix, rest = own - shared.T @ along, pull - along.T @ old_pull
        unbounded = start + np.linalg.lstsq(matrix, rest, rcond=1e-12)[0]
        move = np.clip(unbounded, bounds[:, 0], bounds[:, 1]) - start
        saved = old_pull @ self.covariance @ old_pull + 2.0 * rest @ move - move @ matrix @ move
        return float(self.squares - self._squares(e) + saved)

    @cached_property
    def _prior_change(self) -> Floats:
        return np.asarray((self.a @ (self.inverse @ self.prior_gradient[..., None]))[..., 0])

    def _products(self, columns: Floats) -> Floats:
        """Return the products of columns (R, 3K, q) with the derivatives by all parameters, (P, q)."""
        out = np.zeros((len(self.pull), columns.shape[-1]))
        np.add.at(out, self.own, self.j.transpose(0, 2, 1) @ columns)
        return out


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
    if larger.readings.initial_states is None:
        return fitted.linearisation_point.predicted_gain(residual, slopes, start, bounds)
    terms = terms_of(
        larger, residual, fitted.linear.with_last(slopes), fitted.random_effects, fitted.variance_components
    )
    gradient, matrix = terms.gradient.sum(axis=0), terms.information.total + ridge(larger)
    move = np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0]
    # Parameters beyond a bound are set to it, and the others are solved for again.
    known = len(fitted.parameters)
    clipped = np.clip(start + move[known:], bounds[:, 0], bounds[:, 1])
    if np.any(clipped != start + move[known:]):
        fixed = np.r_[np.zeros(known), clipped - start]
        rest = np.linalg.lstsq(matrix[:known, :known], (gradient - matrix @ fixed)[:known], rcond=1e-12)[0]
        move = np.r_[rest, clipped - start]
    saved = 2.0 * gradient @ move - move @ matrix @ move
    return float(fitted.loss.sum() - terms.loss.sum() + saved)
