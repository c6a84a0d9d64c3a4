"""Where a fit ends does not depend on where it began, nor on how many steps it took."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny

from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import bounds_of
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
