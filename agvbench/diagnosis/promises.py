"""What a larger model promises, to first order: some simulations in place of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agvbench.diagnosis.likelihood import WEAK, inner_inverse, residual_of, ridge, terms_of
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.scatter import priors, weights
from agvbench.effects import effect_kinds
from agvbench.types import Floats

if TYPE_CHECKING:
    from agvbench.diagnosis.fitting import Fit


@dataclass(frozen=True)
class Ground:
    """A fitted model of runs as larger ones are linearised about it, with the runs' offsets projected out.

    ``weight`` (R, K, 3) of residuals; ``a`` (R, 3K, 6) derivatives by the offsets, ``inverse`` (R, 6, 6) of their
    information, ``drawn`` (R, 6) what their prior pulls; ``j`` (3 R K, P) derivatives by the parameters, projected;
    ``covariance`` (P, P); ``pull`` (P,) of the offsets' prior on the parameters.
    """

    weight: Floats
    a: Floats
    inverse: Floats
    drawn: Floats
    j: Floats
    covariance: Floats
    pull: Floats

    @classmethod
    def of(cls, fitted: Fit) -> Ground:
        """Return the ground of a fit."""
        predictor, scatter, offsets = fitted.predictor, fitted.scatter, fitted.offsets
        weight = weights(predictor, scatter)
        runs = len(offsets)
        a = (fitted.linear.by_offsets * weight[..., None]).reshape(runs, -1, 6)
        j = (fitted.linear.by_parameters * weight[..., None]).reshape(runs, a.shape[1], -1)
        prior = priors(predictor, scatter)
        inverse = inner_inverse(a, prior)[1]
        mixed = inverse @ (a.transpose(0, 2, 1) @ j)
        drawn = offsets / prior**2
        matrix = fitted.information.sum(axis=0) + ridge(predictor)
        projected = (j - a @ mixed).reshape(-1, j.shape[-1])
        covariance = np.asarray(np.linalg.inv(matrix))
        return cls(weight, a, inverse, drawn, projected, covariance, np.einsum("rij,ri->j", mixed, drawn))

    def square(self, e: Floats) -> float:
        """Return the weighted squares of residuals `e` (R, 3K), their offsets found anew."""
        pull = np.einsum("rni,rn->ri", self.a, e) - self.drawn
        return float(np.sum(e * e) - np.einsum("ri,rij,rj->", pull, self.inverse, pull, optimize=True))

    def promise(self, residual: Floats, before: Floats, slopes: Floats, start: Floats, bounds: Floats) -> float:
        """Return by how much the loss falls, to first order, from residuals `before` by `residual` and its `slopes`."""
        e = (residual * self.weight).reshape(len(residual), -1)
        new = (slopes * self.weight[..., None]).reshape(*e.shape, -1)
        fixed = new - self.a @ (self.inverse @ (self.a.transpose(0, 2, 1) @ new))
        pull = np.einsum("rnq,rn->q", fixed, e)
        pull += np.einsum("rnq,rni,rij,rj->q", new, self.a, self.inverse, self.drawn, optimize=True)
        old_pull = self.j.T @ e.ravel() + self.pull
        shared = self.j.T @ new.reshape(len(self.j), -1)
        own = np.einsum("rnp,rnq->pq", new, fixed) + WEAK * np.eye(len(start))
        # The maps and effects that there are move along; what is left is a question of the new parameters alone.
        along = self.covariance @ shared
        matrix, rest = own - shared.T @ along, pull - along.T @ old_pull
        wanted = start + np.linalg.lstsq(matrix, rest, rcond=1e-12)[0]
        move = np.clip(wanted, bounds[:, 0], bounds[:, 1]) - start
        saved = old_pull @ self.covariance @ old_pull + 2.0 * rest @ move - move @ matrix @ move
        was = (before * self.weight).reshape(len(residual), -1)
        return float(self.square(was) - self.square(e) + saved)


def begun(fitted: Fit, larger: Predictor, start: Floats) -> Floats:
    """Return the parameters at which a fit of `larger` begins, whose last effect is at `start`: maps lie beside it.

    They do where runs begin at neutral; elsewhere they stay.
    """
    values, maps = fitted.parameters, larger.maps.size
    if larger.readings.begins is None and not larger.readings.stood:
        name = larger.effects[-1]
        kind = next((kind for kind in larger.batch.kinds if kind.name == name), None) or effect_kinds()[name]
        values = np.r_[larger.maps.beside(values[:maps], kind, start), values[maps:]]
    return np.asarray(np.r_[values, start])


def promised_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    """Return by how much the loss would fall with one effect more, its parameters near `start`, to first order.

    `larger` has the effects of `fitted` and then the other. It is linearised at `start`, with the derivatives by what
    was fitted before left as they are: some simulations in place of a fit.
    """
    parameters = begun(fitted, larger, start)
    poses, slopes = larger.by_last(parameters, fitted.offsets, len(start))
    residual = residual_of(larger, poses)
    if larger.readings.begins is None:
        return fitted.ground.promise(residual, fitted.residual, slopes, start, bounds)
    terms = terms_of(larger, residual, fitted.linear.with_last(slopes), fitted.offsets, fitted.scatter)
    gradient, matrix = terms.gradient.sum(axis=0), terms.information.sum(axis=0) + ridge(larger)
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
