"""The marginal likelihood of runs, with their random effects integrated out, and the information of each run.

Laplace's approximation is taken about the best random effects of each run (start pose, both axles, logarithm of speed)
at the current prediction, not about zero.
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
    """Information matrices of R runs about P parameters, stored for each run's m active parameters only.

    ``own`` (R, m): indices of each run's active parameters; ``blocks`` (R, m, m): information about these; ``count`` is
    P.
    """

    own: NDArray[np.int64]
    blocks: Floats
    count: int

    @cached_property
    def total(self) -> Floats:
        """The sum over all runs (P, P)."""
        return self._sum(self._flat_indices, self.blocks)

    def total_of(self, runs: NDArray[np.bool_]) -> Floats:
        """Return the sum over some `runs` (R,), shape (P, P)."""
        return self._sum(self._flat_indices[runs], self.blocks[runs])

    def dense(self) -> Floats:
        """Return the information of every run as a dense array (R, P, P)."""
        out = np.zeros((len(self.own), self.count * self.count))
        np.put_along_axis(out, self._flat_indices.reshape(len(out), -1), self.blocks.reshape(len(out), -1), axis=1)
        return out.reshape(-1, self.count, self.count)

    def along(self, move: Floats) -> Floats:
        """Return the quadratic form of each run's information (R,) along a `move` (P,)."""
        own = move[self.own]
        return np.asarray(np.einsum("rij,ri,rj->r", self.blocks, own, own))

    @cached_property
    def _flat_indices(self) -> NDArray[np.int64]:
        return self.own[:, :, None] * self.count + self.own[:, None, :]

    def _sum(self, indices: NDArray[np.int64], blocks: Floats) -> Floats:
        size = self.count * self.count
        summed = np.bincount(indices.ravel(), blocks.ravel(), size)
        return np.asarray(summed, dtype=np.float64).reshape(self.count, self.count)


WEAK = 1e-4
"""Inverse variance of the weak prior on each of the effects' parameters."""


@dataclass(frozen=True)
class Terms:
    """The likelihood and its derivatives at some parameters.

    ``loss`` (R,): minus two log likelihood of each run; ``information`` and ``gradient`` (R, P): its quadratic
    approximation; ``inner_inverse`` (R, q, q): covariance of the random effects; ``mixed`` (R, q, P): mixed information
    about random effects and parameters; ``pull`` (R, q): gradient by the random effects.
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
    """Return the likelihood of residuals (R, K, 3), with its derivatives from those of the prediction (`linear`)."""
    runs = len(residual)
    temper, count = tempering(predictor)
    weight = weights(predictor, variance_components)
    e = (residual * weight).reshape(runs, -1)
    own = linear.own
    j = (linear.by_own * weight[..., None]).reshape(runs, e.shape[1], own.shape[1])
    a = (linear.by_random_effects * weight[..., None]).reshape(runs, e.shape[1], -1)
    prior = priors(predictor, variance_components)
    at, jt = a.transpose(0, 2, 1), j.transpose(0, 2, 1)
    inner, inverse = inner_inverse(a, prior)
    pull = (at @ e[..., None])[..., 0] - random_effects / prior**2
    cross = at @ j
    rows = np.arange(runs)[:, None]
    mixed = np.zeros((runs, a.shape[2], linear.count))
    mixed[rows, :, own] = cross.transpose(0, 2, 1)
    blocks = jt @ j - cross.transpose(0, 2, 1) @ inverse @ cross
    gradient = np.zeros((runs, mixed.shape[2]))
    marginal = (jt @ e[..., None])[..., 0] - (cross.transpose(0, 2, 1) @ (inverse @ pull[..., None]))[..., 0]
    gradient[rows, own] = marginal
    squares = np.sum(e * e, axis=1) + np.sum((random_effects / prior) ** 2, axis=1)
    # The random effects are one step from their best values: the gain of that step belongs to the loss.
    squares -= np.einsum("ri,rij,rj->r", pull, inverse, pull)
    logs = np.linalg.slogdet(inner)[1] + 2.0 * np.sum(np.log(prior), axis=1)
    logs += (
        temper * count * (4.0 * np.log(variance_components.position_m) + 2.0 * np.log(variance_components.heading_rad))
    )
    if predictor.readings.initial_states is not None:
        logs += 6.0 * temper * (predictor.readings.seen * np.log(variance_components.growth)).sum(axis=1)
    squares, robust_weight = student(predictor, squares)
    blocks *= robust_weight[:, None, None]
    gradient = np.asarray(gradient * robust_weight[:, None])
    information = Information(own, blocks, linear.count)
    return Terms(squares + logs, information, gradient, inverse, mixed, pull)


def random_effects_step(
    predictor: Predictor,
    residual: Floats,
    linear: Linearised,
    random_effects: Floats,
    variance_components: VarianceComponents,
) -> tuple[Floats, Floats]:
    """Return the step of the random effects (R, q) to their best values, and their covariance (R, q, q)."""
    weight, prior = weights(predictor, variance_components), priors(predictor, variance_components)
    e = (residual * weight).reshape(len(residual), -1)
    a = (linear.by_random_effects * weight[..., None]).reshape(*e.shape, -1)
    _, inverse = inner_inverse(a, prior)
    pull = (a.transpose(0, 2, 1) @ e[..., None])[..., 0] - random_effects / prior**2
    return np.einsum("rij,rj->ri", inverse, pull), inverse


def inner_inverse(a: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return the information about each run's random effects (R, q, q), with its inverse."""
    inner = a.transpose(0, 2, 1) @ a
    each = range(prior.shape[1])
    inner[:, each, each] += prior**-2.0
    return inner, np.asarray(np.linalg.inv(inner))


@np.errstate(over="ignore")  # after too long a step the prediction may overflow: the objective is ∞, the step rejected
def objective(
    predictor: Predictor, residual: Floats, random_effects: Floats, variance_components: VarianceComponents
) -> float:
    """Return the weighted sum of squares of residuals and random effects: the objective that no step may increase."""
    temper, _ = tempering(predictor)
    seen = predictor.readings.seen[:, :, None]
    e = residual * seen / scale_of(variance_components)
    squares = temper * np.sum(e * e, axis=(1, 2)) + np.sum(
        (random_effects / priors(predictor, variance_components)) ** 2, axis=1
    )
    return float(student(predictor, squares)[0].sum())


def residual_of(predictor: Predictor, poses: Floats) -> Floats:
    """Return measured minus predicted poses (R, K, 3): 0 if not measured, the largest float if not predicted."""
    residual = np.asarray(predictor.readings.poses - poses)
    residual[np.isnan(poses) & predictor.readings.seen[:, :, None]] = np.inf
    return np.asarray(np.nan_to_num(residual))


def ridge(predictor: Predictor) -> Floats:
    """Return the inverse covariance (P, P) of a weak prior: standard deviations 1 rad, 1 m/s, and 100 for effects.

    It matters only for parameters that the data do not determine.
    """
    strength = np.full(predictor.maps.size + len(predictor.parameter_names), 1.0)
    strength[predictor.maps.size :] = WEAK
    return np.diag(strength)
