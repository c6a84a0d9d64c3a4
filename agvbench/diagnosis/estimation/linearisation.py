"""The linearisation of a fitted model about its parameters, with the random effects of runs projected out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.bounded_step import bounded_step
from agvbench.diagnosis.estimation.likelihood import WEAK, inner_inverse
from agvbench.diagnosis.estimation.variance import VarianceComponents, priors, weights
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.diagnosis.model.smoothness import PriorTerms
from agvbench.types import Floats


@dataclass(frozen=True)
class LinearisationPoint:
    """A fitted model about which larger models are linearised, with the random effects projected out.

    ``weight`` (R, K, 3): weights of the residuals; ``a`` (R, 3K, q): derivatives by the random effects; ``inverse``
    (R, q, q): the inverse of their information; ``prior_gradient`` (R, q): gradient of their prior; ``own`` (R, m):
    indices of each run's active parameters; ``j`` (R, 3K, m): projected derivatives by these; ``covariance`` (P, P) of
    the parameters that are free, zero for those that are held at a bound; ``pull`` (P,): gradient of the prior of the
    random effects by the parameters; ``residual`` (R, 3K), weighted.
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
    def of(
        cls,
        predictor: Predictor,
        linear: Linearised,
        information: Floats,
        free: NDArray[np.bool_],
        variance_components: VarianceComponents,
        random_effects: Floats,
        residual: Floats,
    ) -> LinearisationPoint:
        """Return the linearisation point of a fit: derivatives, total information, random effects and residuals.

        ``free`` (P,): which of its parameters larger models may move.
        """
        weight = weights(predictor, variance_components)
        residual = (residual * weight).reshape(len(weight), -1)
        a = (linear.by_random_effects * weight[..., None]).reshape(*residual.shape, -1)
        j = (linear.by_own * weight[..., None]).reshape(*residual.shape, -1)
        prior = priors(predictor, variance_components)
        inverse = inner_inverse(a, prior)[1]
        mixed = inverse @ (a.transpose(0, 2, 1) @ j)
        prior_gradient = random_effects / prior**2
        pull = np.zeros(len(information))
        np.add.at(pull, linear.own, np.einsum("rij,ri->rj", mixed, prior_gradient))
        covariance = np.zeros_like(information)
        covariance[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
        return cls(weight, a, inverse, prior_gradient, linear.own, j - a @ mixed, covariance, pull, residual)

    @cached_property
    def squares(self) -> float:
        """The weighted sum of squares of the fit's residuals."""
        return self._squares(self.residual)

    def _squares(self, e: Floats) -> float:
        """Return the weighted sum of squares of residuals `e` (R, 3K), minimised over the random effects."""
        pull = (self.a.transpose(0, 2, 1) @ e[..., None])[..., 0] - self.prior_gradient
        return float(np.sum(e * e) - np.sum(pull * (self.inverse @ pull[..., None])[..., 0]))

    def predicted_gain(
        self, residual: Floats, slopes: Floats, start: Floats, bounds: Floats, prior: PriorTerms
    ) -> float:
        """Return the predicted reduction of the loss, to first order, from the larger model's linearisation.

        `residual` (R, K, 3) is that of the larger model at `start` (q,). `slopes` (R, K, 3, q) are the derivatives by
        its new parameters, and `bounds` (q, 2) their bounds. `prior` is that of all P + q parameters of the larger
        model, at the linearisation.
        """
        e = (residual * self.weight).reshape(len(residual), -1)
        new = (slopes * self.weight[..., None]).reshape(*e.shape, -1)
        projected = new - self.a @ (self.inverse @ (self.a.transpose(0, 2, 1) @ new))
        # The prior of the random effects contributes to the gradient, too.
        pull = np.einsum("rnq,rn->q", projected, e) + np.einsum("rnq,rn->q", new, self._prior_change)
        products = self._products(np.concatenate([e[..., None], new], axis=-1))
        known = len(self.pull)
        old_pull = products[:, 0] + self.pull + prior.gradient[:known]
        shared, pull = products[:, 1:] + prior.information[:known, known:], pull + prior.gradient[known:]
        own = np.einsum("rnp,rnq->pq", new, projected) + WEAK * np.eye(len(start)) + prior.information[known:, known:]
        # The existing parameters are eliminated (Schur complement): the new parameters remain.
        along = self.covariance @ shared
        matrix, rest = own - shared.T @ along, pull - along.T @ old_pull
        move = bounded_step(matrix, rest, start, bounds)
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
