"""Nodal maps and effects fitted together, with what differs from run to run integrated out.

Each run has its own start pose, an offset of each axle and a factor on its speed: random effects about zero, whose
variance is estimated, too. Without them a run's frames would pass for as many pieces of evidence, and the smallest play
in a servo for an effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agvbench.diagnosis.estimation.levenberg_marquardt import Convergence, FitState, LevenbergMarquardt
from agvbench.diagnosis.estimation.likelihood import Information, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.score_test import LinearisationPoint
from agvbench.diagnosis.estimation.variance import (
    VarianceComponents,
    initial_variance_components,
    window_variance_components,
)
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.types import Floats

_ITERATIONS = 8


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``parameters`` (P,), the maps' values first; ``random_effects`` (R, 6) of each run; ``variance_components``;
    ``loss`` (R,): minus two log likelihood of each run; ``information`` and ``gradient`` (R, P): its quadratic form
    about them; ``residual`` (R, K, 3): measured minus predicted with the random effects.
    """

    predictor: Predictor
    parameters: Floats
    random_effects: Floats
    variance_components: VarianceComponents
    loss: Floats
    information: Information
    gradient: Floats
    residual: Floats
    linear: Linearised

    @property
    def covariance(self) -> Floats:
        """Covariance of the parameters (P, P)."""
        return np.asarray(np.linalg.pinv(self.information.total + ridge(self.predictor), hermitian=True))

    @cached_property
    def linearisation_point(self) -> LinearisationPoint:
        """What every predicted gain of a larger model starts from."""
        return LinearisationPoint.of(self)

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
    """Fit by Gauss–Newton with safe steps, the variance components by expectation maximisation between steps.

    Parameters
    ----------
    predictor
        Runs, maps and effects.
    parameters
        (P,) where to start.
    bounds
        (effects' parameters, 2): lowest and highest value of each.
    random_effects, variance_components
        Where to start; by default none and generous.
    iterations
        At most this many steps.
    patient
        Whether to go on for some rounds of as many steps while they are worth it.
    near
        Derivatives of the same maps at parameters close by. By far the most time goes into those by the maps' values,
        and they change little: the first steps are taken with these, the last ones and the result with one's own.
    """
    readings = predictor.readings
    random_effects = np.zeros((len(readings), 6)) if random_effects is None else random_effects.copy()
    variance_components = variance_components or (
        initial_variance_components()
        if predictor.readings.initial_states is None
        else window_variance_components(readings)
    )
    solver = LevenbergMarquardt(predictor, bounds)
    state, convergence = solver.go(FitState(parameters.copy(), random_effects, variance_components), iterations, near)
    # Only a final fit is worth the iterations to convergence.
    prior_model = iterations > _ITERATIONS
    state, evaluation = solver.converge(
        state, convergence if prior_model else Convergence.CONVERGED, iterations, patient=patient
    )
    if prior_model:
        state, evaluation = solver.leave_plateaus(state, evaluation, iterations, patient=patient)
    terms = evaluation.terms
    return Fit(
        predictor, state.parameters, state.random_effects, state.variance_components,
        terms.loss, terms.information, terms.gradient, evaluation.residual, evaluation.linear,
    )  # fmt: skip


def loss_at(fitted: Fit, parameters: Floats) -> Floats:
    """Return each run's loss (R,) at other parameters, by simulation, with the variance components of `fitted`."""
    predictor = fitted.predictor
    residual = residual_of(predictor, predictor.predict(parameters, fitted.random_effects))
    return terms_of(
        predictor, residual, fitted.linear.by_first(0), fitted.random_effects, fitted.variance_components
    ).loss
