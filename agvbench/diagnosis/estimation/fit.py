"""Maximum likelihood fit of nodal maps and effects, with each run's random effects integrated out.

The random effects of a run are its start pose, an offset of each axle and a factor on speed. They have mean zero, and
their standard deviations (variance components) are estimated in the same fit. Without random effects, all frames of a
run would count as independent observations, and a small backlash of a servo would be taken for an effect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.estimation.levenberg_marquardt import Convergence, FitState, LevenbergMarquardt
from agvbench.diagnosis.estimation.likelihood import Information, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.linearisation import LinearisationPoint
from agvbench.diagnosis.estimation.variance import (
    VarianceComponents,
    initial_variance_components,
    window_variance_components,
)
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.diagnosis.model.smoothness import PriorTerms
from agvbench.types import Floats

_ITERATIONS = 8


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``parameters`` (P,), the nodal values first; ``random_effects`` (R, q) of each run; ``variance_components``;
    ``loss`` (R,): minus two log likelihood of each run; ``information`` and ``gradient`` (R, P): the quadratic
    approximation of the loss at the parameters; ``prior``: that of maps and effects; ``residual`` (R, K, 3): measured
    minus predicted poses, with the random effects; ``linear``: the derivatives at the parameters; ``bounds`` (effects'
    parameters, 2).
    """

    predictor: Predictor
    parameters: Floats
    random_effects: Floats
    variance_components: VarianceComponents
    loss: Floats
    information: Information
    gradient: Floats
    prior: PriorTerms
    residual: Floats
    linear: Linearised
    bounds: Floats

    @property
    def total_loss(self) -> float:
        """Minus two log posterior: the loss of all runs and of the priors."""
        return float(self.loss.sum()) + self.prior.loss

    @property
    def total_information(self) -> Floats:
        """The information of all runs and of the priors (P, P)."""
        return self.information.total + ridge(self.predictor) + self.prior.information

    @property
    def total_gradient(self) -> Floats:
        """Minus half the derivative of the total loss (P,)."""
        return np.asarray(self.gradient.sum(axis=0) + self.prior.gradient)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which parameters (P,) may move: all but those at a bound that the loss presses against it."""
        own, gradient = (values[self.predictor.maps.size :] for values in (self.parameters, self.total_gradient))
        low, high = self.bounds.T
        pressed = ((own <= low) & (gradient < 0.0)) | ((own >= high) & (gradient > 0.0))
        return np.asarray(np.r_[np.ones(self.predictor.maps.size, dtype=np.bool_), ~pressed])

    @property
    def decrement(self) -> float:
        """The reduction of the loss that a further step is predicted to bring (Newton decrement, squared)."""
        gradient = self.total_gradient[self.free]
        matrix = self.total_information[np.ix_(self.free, self.free)]
        return float(gradient @ np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0])

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the parameters (P, P)."""
        return np.asarray(np.linalg.pinv(self.total_information, hermitian=True))

    @property
    def covariance_by_priors(self) -> Floats:
        """The part of the covariance (P, P) that the priors of the effects' parameters contribute as observations."""
        own = self.parameters[self.predictor.maps.size :]
        information = self.predictor.physical.terms(own, self.predictor.maps.size).information
        return np.asarray(self.covariance @ information @ self.covariance)

    @cached_property
    def linearisation_point(self) -> LinearisationPoint:
        """The point at which the predicted gain of every larger model is linearised."""
        return LinearisationPoint.of(
            self.predictor,
            self.linear,
            self.total_information,
            self.free,
            self.variance_components,
            self.random_effects,
            self.residual,
        )

    def predicted_loss_without(self, name: str) -> float:
        """Return the increase of the loss without the effect called `name`, by the quadratic approximation.

        The parameter of a limit is replaced by its inverse, whose null value is 0: to first order both have the same
        relative error.
        """
        own = np.array([key.partition(".")[0] == name for key in self.predictor.parameter_names])
        nulls = self.predictor.nulls[own]
        off = self.parameters[self.predictor.maps.size :][own] - np.where(np.isfinite(nulls), nulls, 0.0)
        at = self.predictor.maps.size + np.flatnonzero(own)
        return float(off @ np.linalg.pinv(self.covariance[np.ix_(at, at)], hermitian=True) @ off)

    def effect_values(self) -> dict[str, float]:
        """Return the effects' parameters by name."""
        own = self.parameters[self.predictor.maps.size :]
        return dict(zip(self.predictor.parameter_names, own.tolist(), strict=True))


def fit(
    predictor: Predictor,
    parameters: Floats,
    bounds: Floats,
    *,
    random_effects: Floats | None = None,
    variance_components: VarianceComponents | None = None,
    iterations: int = _ITERATIONS,
    patient: bool = False,
    near: Linearised | None = None,
) -> Fit:
    """Fit by damped Gauss–Newton steps; between steps, expectation maximisation updates the variance components.

    Parameters
    ----------
    predictor
        Runs, maps and effects.
    parameters
        (P,): initial values.
    bounds
        (effects' parameters, 2): lowest and highest value of each.
    random_effects, variance_components
        Initial values; by default zero, and large standard deviations.
    iterations
        The largest number of steps per round.
    patient
        Whether further rounds follow as long as each reduces the loss enough.
    near
        Derivatives of a model with the same maps at similar parameters. Derivatives take most of the time and change
        little: the first steps use those of `near`, the last step and the result have their own.
    """
    readings = predictor.readings
    random_effects = predictor.no_random_effects() if random_effects is None else random_effects.copy()
    variance_components = variance_components or (
        initial_variance_components()
        if predictor.readings.initial_states is None
        else window_variance_components(readings)
    )
    solver = LevenbergMarquardt(predictor, bounds)
    iterated = solver.iterate(FitState(parameters.copy(), random_effects, variance_components), iterations, near)
    # A fit with few steps is a preliminary one, which need not converge.
    to_convergence = iterations > _ITERATIONS
    if not to_convergence:
        iterated = replace(iterated, convergence=Convergence.CONVERGED)
    state, evaluation = solver.converge(iterated, iterations, patient=patient)
    if to_convergence:
        state, evaluation = solver.leave_plateaus(state, evaluation, iterations, patient=patient)
    terms = evaluation.terms
    return Fit(
        predictor, state.parameters, state.random_effects, state.variance_components,
        terms.loss, terms.information, terms.gradient, evaluation.prior, evaluation.residual, evaluation.linear, bounds,
    )  # fmt: skip


def fit_near(
    known: Fit,
    predictor: Predictor,
    parameters: Floats,
    bounds: Floats,
    *,
    iterations: int = _ITERATIONS,
    patient: bool = False,
) -> Fit:
    """Fit a model from the random effects, variance components and derivatives of a `known` one with the same maps.

    For the other arguments see `fit`.
    """
    return fit(
        predictor,
        parameters,
        bounds,
        random_effects=known.random_effects,
        variance_components=known.variance_components,
        iterations=iterations,
        patient=patient,
        near=known.linear,
    )


def loss_at(fitted: Fit, parameters: Floats) -> Floats:
    """Return each run's loss (R,) at other parameters, by simulation, with the variance components of `fitted`."""
    predictor = fitted.predictor
    residual = residual_of(predictor, predictor.predict(parameters, fitted.random_effects))
    return terms_of(
        predictor, residual, fitted.linear.by_first(0), fitted.random_effects, fitted.variance_components
    ).loss
