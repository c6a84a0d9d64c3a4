"""The likelihood of runs with their random effects integrated out, and the information in each run.

Each run's offsets (start pose, both axles, log of speed) are found anew about every prediction, not once about zero,
and enter by Laplace's approximation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.variance import VarianceComponents, priors, scale_of, student, tempering, weights
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.types import Floats


@dataclass(frozen=True)
class Information:
    """Quadratic forms of R runs in P parameters, of which each run depends on m at most.

    ``own`` (R, m): the numbers of these; ``blocks`` (R, m, m): the forms in them; ``count`` is P.
    """

    own: NDArray[np.int64]
    blocks: Floats
    count: int

    @cached_property
    def total(self) -> Floats:
        """The sum over all runs (P, P)."""
        return self._sum(self._places, self.blocks)

    def total_of(self, runs: NDArray[np.bool_]) -> Floats:
        """Return the sum over some `runs` (R,), shape (P, P)."""
        return self._sum(self._places[runs], self.blocks[runs])

    def dense(self) -> Floats:
        """Return every run's form (R, P, P), zeros and all."""
        out = np.zeros((len(self.own), self.count * self.count))
        np.put_along_axis(out, self._places.reshape(len(out), -1), self.blocks.reshape(len(out), -1), axis=1)
        return out.reshape(-1, self.count, self.count)

    def along(self, move: Floats) -> Floats:
        """Return what each run's form (R,) makes of a `move` (P,)."""
        own = move[self.own]
        return np.asarray(np.einsum("rij,ri,rj->r", self.blocks, own, own))

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        return self.own[:, :, None] * self.count + self.own[:, None, :]

    def _sum(self, places: NDArray[np.int64], blocks: Floats) -> Floats:
        size = self.count * self.count
        summed = np.bincount(places.ravel(), blocks.ravel(), size)
        return np.asarray(summed, dtype=np.float64).reshape(self.count, self.count)


WEAK = 1e-4
"""How little (as an inverse variance) is taken for granted of an effect's parameter."""


@dataclass(frozen=True)
class Terms:
    """A likelihood about some parameters.

    ``loss`` (R,): minus two log likelihood of each run; ``information`` and ``gradient`` (R, P): its quadratic form;
    ``inner_inverse`` (R, 6, 6): the offsets' covariance; ``mixed`` (R, 6, P) and ``pull`` (R, 6): how
    they follow the parameters, and where they are drawn.
    """

    loss: Floats
    information: Information
    gradient: Floats
    inner_inverse: Floats
    mixed: Floats
    pull: Floats


def terms_of(
    predictor: Predictor,
    residual: Floats,
    linear: Linearised,
    random_effects: Floats,
    variance_components: VarianceComponents,
) -> Terms:
    """Return the likelihood of residuals (R, K, 3) of predictions with these derivatives."""
    runs = len(residual)
    temper, count = tempering(predictor)
    weight = weights(predictor, variance_components)
    e = (residual * weight).reshape(runs, -1)
    own = linear.own
    j = (linear.by_own * weight[..., None]).reshape(runs, e.shape[1], own.shape[1])
    a = (linear.by_random_effects * weight[..., None]).reshape(runs, e.shape[1], 6)
    prior = priors(predictor, variance_components)
    at, jt = a.transpose(0, 2, 1), j.transpose(0, 2, 1)
    inner, inverse = inner_inverse(a, prior)
    pull = (at @ e[..., None])[..., 0] - random_effects / prior**2
    short = at @ j
    rows = np.arange(runs)[:, None]
    mixed = np.zeros((runs, 6, linear.count))
    mixed[rows, :, own] = short.transpose(0, 2, 1)
    blocks = jt @ j - short.transpose(0, 2, 1) @ inverse @ short
    gradient = np.zeros((runs, mixed.shape[2]))
    steep = (jt @ e[..., None])[..., 0] - (short.transpose(0, 2, 1) @ (inverse @ pull[..., None]))[..., 0]
    gradient[rows, own] = steep
    squares = np.sum(e * e, axis=1) + np.sum((random_effects / prior) ** 2, axis=1)
    # The offsets are a step away from their best values: what that step gains belongs to the loss.
    squares -= np.einsum("ri,rij,rj->r", pull, inverse, pull)
    logs = np.linalg.slogdet(inner)[1] + 2.0 * np.sum(np.log(prior), axis=1)
    logs += (
        temper * count * (4.0 * np.log(variance_components.position_m) + 2.0 * np.log(variance_components.heading_rad))
    )
    if predictor.readings.initial_states is not None:
        logs += 6.0 * temper * (predictor.readings.seen * np.log(variance_components.growth)).sum(axis=1)
        squares, trust = student(predictor, squares)
        blocks *= trust[:, None, None]
        gradient = np.asarray(gradient * trust[:, None])
    information = Information(own, blocks, linear.count)
    return Terms(squares + logs, information, gradient, inverse, mixed, pull)


def inner_inverse(a: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return the information on each run's offsets (R, 6, 6), with its inverse."""
    inner = a.transpose(0, 2, 1) @ a
    inner[:, range(6), range(6)] += prior**-2.0
    return inner, np.asarray(np.linalg.inv(inner))


@np.errstate(over="ignore")  # what a step too far predicts may be beyond all numbers: infinitely bad, and not taken
def objective(
    predictor: Predictor, residual: Floats, random_effects: Floats, variance_components: VarianceComponents
) -> float:
    """Return the weighted squares of residuals and offsets: what a step must not make larger."""
    temper, _ = tempering(predictor)
    seen = predictor.readings.seen[:, :, None]
    e = residual * seen / scale_of(variance_components)
    squares = temper * np.sum(e * e, axis=(1, 2)) + np.sum(
        (random_effects / priors(predictor, variance_components)) ** 2, axis=1
    )
    if predictor.readings.initial_states is not None:
        squares, _ = student(predictor, squares)
    return float(squares.sum())


def residual_of(predictor: Predictor, poses: Floats) -> Floats:
    """Return measured minus predicted poses (R, K, 3): 0 where nothing was measured, huge where none is predicted."""
    residual = np.asarray(predictor.readings.poses - poses)
    residual[np.isnan(poses) & predictor.readings.seen[:, :, None]] = np.inf
    return np.asarray(np.nan_to_num(residual))


def ridge(predictor: Predictor) -> Floats:
    """Return a prior so weak that it only speaks where the data say nothing: 1 rad, 1 m/s, 100 for effects."""
    strength = np.full(predictor.maps.size + len(predictor.parameter_names), 1.0)
    strength[predictor.maps.size :] = WEAK
    return np.diag(strength)
