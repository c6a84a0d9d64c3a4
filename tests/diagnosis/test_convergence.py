"""Where a fit ends does not depend on where it began, nor on how many steps it took."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize
from tiny_selector import selector_of
from tiny_vehicle import Tiny

from agvbench.diagnosis.estimation.bounded_step import bounded_step
from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import bounds_of, default_candidate
from agvbench.diagnosis.selection.fitted_models import FittedModels

NAMES = ("steering_lag", "speed_lag")
STEPS = 12


@pytest.fixture(scope="module")
def selector(tiny_campaign):
    return selector_of(tiny_campaign(Tiny(steering_lag_s=0.1, accelerate_s=0.15, brake_s=0.15, cornering_loss=0.05)))


@pytest.fixture(scope="module")
def fitted(selector):
    return fit_from(selector, [0.05, 0.1, 0.1])


def fit_from(selector: FittedModels, start: list[float], near: Fit | None = None) -> Fit:
    """Return the fit of two effects; the loss of speed in turns that both lack leaves large residuals."""
    return fit(
        Predictor(selector.batch, NAMES),
        np.r_[selector.base().fit.parameters, start],
        bounds_of(NAMES),
        random_effects=None if near is None else near.random_effects,
        variance_components=None if near is None else near.variance_components,
        iterations=STEPS,
        patient=True,
        near=None if near is None else near.linear,
    )


def test_from_other_initial_values_it_ends_at_the_same_optimum(selector, fitted):
    again = fit_from(selector, [0.3, 0.03, 0.3])
    assert again.total_loss == pytest.approx(fitted.total_loss, abs=0.5)
    np.testing.assert_allclose(again.parameters, fitted.parameters, atol=2e-3)


def test_from_derivatives_of_another_model_it_ends_at_the_same_optimum(selector, fitted):
    again = fit_from(selector, [0.05, 0.1, 0.1], selector.with_effect(selector.base(), "steering_lag").fit)
    assert again.total_loss == pytest.approx(fitted.total_loss, abs=0.5)
    np.testing.assert_allclose(again.parameters, fitted.parameters, atol=2e-3)


def test_other_initial_variance_components_lead_to_the_same_ones(selector, fitted):
    wide = replace(fitted.variance_components, random_effects=10.0 * fitted.variance_components.random_effects)
    start = replace(fitted, variance_components=wide)
    again = fit_from(selector, fitted.parameters[-3:].tolist(), start)
    assert again.variance_components.change_to(fitted.variance_components) < 0.1
    assert again.total_loss == pytest.approx(fitted.total_loss, abs=0.5)


@pytest.fixture(scope="module")
def faster_in_turns(tiny_campaign):
    """Return a selector for a vehicle that gains speed in turns, which no loss of speed describes."""
    return selector_of(tiny_campaign(Tiny(accelerate_s=0.15, brake_s=0.15, cornering_loss=-0.05)))


def pressed(selector: FittedModels, loss: float) -> Fit:
    """Return the fit of a loss of speed in turns, which the runs press against its bound, from this `loss`."""
    names = ("cornering_speed_loss", "speed_lag")
    start = np.r_[selector.base().fit.parameters, loss, 0.1, 0.1]
    return fit(Predictor(selector.batch, names), start, bounds_of(names), iterations=STEPS)


def test_a_parameter_next_to_its_bound_does_not_stop_the_others(faster_in_turns):
    without = faster_in_turns.with_effect(faster_in_turns.base(), "speed_lag").fit
    for loss in (1e-6, 1e-3, 0.1):
        fitted = pressed(faster_in_turns, loss)
        assert fitted.effect_values()["cornering_speed_loss.loss"] == 0.0
        assert fitted.total_loss == pytest.approx(without.total_loss, abs=0.5)


def test_what_a_bound_forbids_is_no_predicted_gain(faster_in_turns):
    fitted = pressed(faster_in_turns, 1e-3)
    assert not fitted.free[-3]
    assert fitted.free.sum() == len(fitted.parameters) - 1
    assert fitted.decrement < 1.0
    kind = default_candidate("mocap_latency")
    larger = Predictor(faster_in_turns.batch, (*fitted.predictor.effects, "mocap_latency"))
    start = np.r_[fitted.parameters, kind.starts[0]]
    found = fit(larger, start, bounds_of(larger.effects), iterations=STEPS)
    predicted = first_order_gain(fitted, larger, kind.starts[0], kind.bounds)
    assert predicted == pytest.approx(fitted.total_loss - found.total_loss, abs=3.0)


@given(seed=st.integers(0, 10_000), count=st.integers(1, 5))
def test_a_step_is_the_best_within_all_bounds(seed, count):
    rng = np.random.default_rng(seed)
    root, gradient = rng.normal(size=(12, 6)), rng.normal(size=6)
    bounds, own = np.tile([0.0, 0.5], (count, 1)), rng.choice([0.0, 1e-6, 0.2, 0.5], size=count)
    move = bounded_step(root.T @ root, gradient, np.r_[rng.normal(size=6 - count), own], bounds)
    # The quadratic approximation of the objective is |root @ move - target|² but for a constant.
    target, far = root @ np.linalg.solve(root.T @ root, gradient), np.full(6 - count, np.inf)
    best = optimize.lsq_linear(root, target, (np.r_[-far, -own], np.r_[far, 0.5 - own]), method="bvls").x
    np.testing.assert_allclose(move, best, atol=1e-6)
