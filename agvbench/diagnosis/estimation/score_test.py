"""The predicted gain of a larger model, to first order: some simulations in place of a fit."""

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
    """A fitted model of runs as larger ones are linearised about it, with the runs' offsets projected out.

    ``weight`` (R, K, 3) of residuals; ``a`` (R, 3K, 6) derivatives by the offsets, ``inverse`` (R, 6, 6) of their
    information, ``drawn`` (R, 6) what their prior pulls; ``own`` (R, m) the numbers of the parameters that each run
    depends on at most, ``j`` (R, 3K, m) derivatives by these, projected; ``covariance`` (P, P); ``pull`` (P,) of the
    offsets' prior on the parameters; ``residual`` (R, 3K), weighted.
    """

    weight: Floats
    a: Floats
    inverse: Floats
    drawn: Floats
    own: NDArray[np.int64]
    j: Floats
    covariance: Floats
    pull: Floats
    residual: Floats

    @classmethod
    def of(cls, fitted: Fit) -> LinearisationPoint:
        """Return the ground of a fit."""
        predictor, variance_components, linear = fitted.predictor, fitted.variance_components, fitted.linear
        weight = weights(predictor, variance_components)
        residual = (fitted.residual * weight).reshape(len(weight), -1)
        a = (linear.by_random_effects * weight[..., None]).reshape(*residual.shape, -1)
        j = (linear.by_own * weight[..., None]).reshape(*residual.shape, -1)
        prior = priors(predictor, variance_components)
        inverse = inner_inverse(a, prior)[1]
        mixed = inverse @ (a.transpose(0, 2, 1) @ j)
        drawn = fitted.random_effects / prior**2
        matrix = fitted.information.total + ridge(predictor)
        pull = np.zeros(len(matrix))
        np.add.at(pull, linear.own, np.einsum("rij,ri->rj", mixed, drawn))
        covariance = np.asarray(np.linalg.inv(matrix))
        return cls(weight, a, inverse, drawn, linear.own, j - a @ mixed, covariance, pull, residual)

    @cached_property
    def squares(self) -> float:
        """The weighted squares of the fit's own residuals."""
        return self._squares(self.residual)

    def _squares(self, e: Floats) -> float:
        """Return the weighted squares of residuals `e` (R, 3K), their offsets found anew."""
        pull = (self.a.transpose(0, 2, 1) @ e[..., None])[..., 0] - self.drawn
        return float(np.sum(e * e) - np.sum(pull * (self.inverse @ pull[..., None])[..., 0]))

    def predicted_gain(self, residual: Floats, slopes: Floats, start: Floats, bounds: Floats) -> float:
        """Return by how much the loss falls, to first order, by `residual` (R, K, 3) and its `slopes`."""
        e = (residual * self.weight).reshape(len(residual), -1)
        new = (slopes * self.weight[..., None]).reshape(*e.shape, -1)
        fixed = new - self.a @ (self.inverse @ (self.a.transpose(0, 2, 1) @ new))
        # What the offsets' prior pulls comes in by the same way.
        pull = np.einsum("rnq,rn->q", fixed, e) + np.einsum("rnq,rn->q", new, self._drawn_along)
        onto = self._onto(np.concatenate([e[..., None], new], axis=-1))
        old_pull, shared = onto[:, 0] + self.pull, onto[:, 1:]
        own = np.einsum("rnp,rnq->pq", new, fixed) + WEAK * np.eye(len(start))
        # The maps and effects that there are move along; what is left is a question of the new parameters alone.
        along = self.covariance @ shared
        matrix, rest = own - shared.T @ along, pull - along.T @ old_pull
        wanted = start + np.linalg.lstsq(matrix, rest, rcond=1e-12)[0]
        move = np.clip(wanted, bounds[:, 0], bounds[:, 1]) - start
        saved = old_pull @ self.covariance @ old_pull + 2.0 * rest @ move - move @ matrix @ move
        return float(self.squares - self._squares(e) + saved)

    @cached_property
    def _drawn_along(self) -> Floats:
        return np.asarray((self.a @ (self.inverse @ self.drawn[..., None]))[..., 0])

    def _onto(self, columns: Floats) -> Floats:
        """Return the products of columns (R, 3K, q) with the derivatives by all parameters, (P, q)."""
        out = np.zeros((len(self.pull), columns.shape[-1]))
        np.add.at(out, self.own, self.j.transpose(0, 2, 1) @ columns)
        return out


def begun(fitted: Fit, larger: Predictor, start: Floats) -> Floats:
    """Return the parameters at which a fit of `larger` begins, whose last effect is at `start`: maps lie beside it.

    They do where runs begin at neutral; elsewhere they stay.
    """
    values, maps = fitted.parameters, larger.maps.size
    if larger.readings.initial_states is None and not larger.readings.preset:
        name = larger.effects[-1]
        kind = next((kind for kind in larger.batch.kinds if kind.name == name), None) or effect_kinds()[name]
        values = np.r_[larger.maps.beside(values[:maps], kind, start), values[maps:]]
    return np.asarray(np.r_[values, start])


def first_order_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    """Return by how much the loss would fall with one effect more, its parameters near `start`, to first order.

    `larger` has the effects of `fitted` and then the other. It is linearised at `start`, with the derivatives by what
    was fitted before left as they are: some simulations in place of a fit.
    """
    parameters = begun(fitted, larger, start)
    poses, slopes = larger.by_last(parameters, fitted.random_effects, len(start))
    residual = residual_of(larger, poses)
    if larger.readings.initial_states is None:
        return fitted.linearisation_point.predicted_gain(residual, slopes, start, bounds)
    terms = terms_of(
        larger, residual, fitted.linear.with_last(slopes), fitted.random_effects, fitted.variance_components
    )
    gradient, matrix = terms.gradient.sum(axis=0), terms.information.total + ridge(larger)
    move = np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0]
    # What would go beyond its bound stops there, and the rest is solved for again.
    known = len(fitted.parameters)
    ends = np.clip(start + move[known:], bounds[:, 0], bounds[:, 1])
    if np.any(ends != start + move[known:]):
        held = np.r_[np.zeros(known), ends - start]
        rest = np.linalg.lstsq(matrix[:known, :known], (gradient - matrix @ held)[:known], rcond=1e-12)[0]
        move = np.r_[rest, ends - start]
    saved = 2.0 * gradient @ move - move @ matrix @ move
    return float(fitted.loss.sum() - terms.loss.sum() + saved)
