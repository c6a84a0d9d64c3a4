"""Priors of the effects' parameters: documents and separate measurements, as further observations of every model.

A prior is one observation of a quantity ``effect.parameter`` with a Gaussian error. In a model without the effect the
quantity has its null value. An observation that excludes the null value is therefore evidence for the effect in every
comparison of models, and one close to the null value is evidence against it.

The quantity of a limit, whose null value is infinite, is the reciprocal: that of an infinite limit is zero. Its error
is propagated to first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.smoothness import PriorTerms
from agvbench.effects.variants import cause_of, weights_in
from agvbench.model.priors import Prior, is_limit
from agvbench.types import Floats


@dataclass(frozen=True)
class PhysicalPriors:
    """N priors of the E parameters of the effects of one model.

    ``weights`` (N, E): the quantity of each prior as a weighted sum of deviations of parameters from their null values,
    or of reciprocals where ``reciprocal`` (N,). ``nulls`` (E,) of the parameters. ``value`` (N,) and ``deviation`` (N,)
    are those of the stated quantities, ``null`` (N,) their values without the effect. ``silent`` (N,) are priors of
    variants that do not define the quantity: they say nothing.
    """

    weights: Floats
    nulls: Floats
    reciprocal: NDArray[np.bool_]
    value: Floats
    deviation: Floats
    null: Floats
    silent: NDArray[np.bool_]

    @classmethod
    def of(
        cls, priors: Sequence[Prior], effects: Sequence[str], parameter_names: Sequence[str], nulls: Floats
    ) -> PhysicalPriors:
        """Return the priors of a model with these effects, whose parameters have `parameter_names` and `nulls` (E,)."""
        weights = np.zeros((len(priors), len(parameter_names)))
        silent = np.zeros(len(priors), dtype=np.bool_)
        for k, prior in enumerate(priors):
            for effect in effects:
                own = weights_in(effect, prior.name)
                silent[k] |= not own and is_form_of(effect, prior)
                for name, weight in own.items():
                    weights[k, parameter_names.index(f"{effect}.{name}")] = weight
        reciprocal = np.array([is_limit(prior) for prior in priors], dtype=np.bool_)
        value = np.array([prior.value for prior in priors])
        deviation = np.array([prior.standard_deviation for prior in priors])
        return cls(
            weights,
            nulls,
            reciprocal,
            np.divide(1.0, value, out=value.copy(), where=reciprocal),
            np.divide(deviation, value**2, out=deviation.copy(), where=reciprocal),
            np.array([0.0 if is_limit(prior) else prior.null for prior in priors]),
            silent,
        )

    def __len__(self) -> int:
        return len(self.value)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which of the quantities the model has a parameter of, (N,)."""
        return np.asarray(self.weights.any(axis=1))

    def quantities(self, own: Floats) -> Floats:
        """Return the quantities (N,) for the effects' parameters `own` (E,)."""
        terms = np.where(self.reciprocal[:, None], _reciprocals(own)[None, :], self._deviations(own)[None, :])
        return np.asarray(self.null + np.sum(self.weights * terms, axis=1))

    def slopes(self, own: Floats) -> Floats:
        """Return the derivatives of the quantities by the effects' parameters, (N, E)."""
        return np.asarray(np.where(self.reciprocal[:, None], -(_reciprocals(own) ** 2)[None, :], 1.0) * self.weights)

    def deviations(self, own: Floats) -> Floats:
        """Return by how many standard deviations the quantities (N,) deviate from their priors."""
        return np.where(self.silent, 0.0, (self.quantities(own) - self.value) / self.deviation)

    def loss(self, own: Floats) -> float:
        """Return minus two log density at the effects' parameters `own` (E,), less that of agreement."""
        return float(np.sum(self.deviations(own) ** 2))

    def terms(self, own: Floats, maps: int) -> PriorTerms:
        """Return the priors at the effects' parameters `own` (E,), which follow after `maps` nodal values."""
        count, z = maps + len(own), self.deviations(own)
        whitened = np.zeros((len(self), count))
        whitened[:, maps:] = self.slopes(own) / self.deviation[:, None]
        loss = float(np.sum(z**2))
        return PriorTerms(loss, whitened.T @ whitened, -whitened.T @ z, of_effects=loss)

    def _deviations(self, own: Floats) -> Floats:
        return own - np.where(np.isfinite(self.nulls), self.nulls, 0.0)


def is_form_of(effect: str, prior: Prior) -> bool:
    """Return whether `effect` is the effect of the prior or one of its variants."""
    return cause_of(effect) == prior.effect


def _reciprocals(own: Floats) -> Floats:
    return np.divide(1.0, own, out=np.zeros_like(own), where=own != 0.0)
