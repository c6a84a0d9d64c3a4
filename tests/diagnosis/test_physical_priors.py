"""Priors of effects as observations: loss, gradient, information, predicted gain, cross-validation, standard errors."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import HEADER, NEUTRAL_COMMAND, Tiny, campaign_runs
from whole_information import every_parameter

from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.estimation.fit import fit
from agvbench.diagnosis.estimation.levenberg_marquardt import FitState, LevenbergMarquardt
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.estimation.standard_errors import standard_errors
from agvbench.diagnosis.estimation.variance import initial_variance_components
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, nodal_maps
from agvbench.diagnosis.model.physical_priors import PhysicalPriors
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.model import nominal_model
from agvbench.model.priors import Prior
from agvbench.vehicle.channels import Channels

LATENCY = Prior("mocap_latency", "latency_s", 0.008, 0.001, "data sheet")
DELAY = Prior("actuation_delay", "delay_s", 0.0, 0.001, "oscilloscope")
RATE = Prior("steering_rate_limit", "rate_rad_per_s", 8.0, 1.0, "data sheet")
WHEELBASE = Prior("wheelbase_error", "longer", 0.0, 0.005, "ruler")


def physical(priors, **effects):
    """Return the priors of a model, given the names of its parameters by effect."""
    names = [f"{effect}.{name}" for effect, own in effects.items() for name in own]
    nulls = np.array([np.inf if name.endswith("rate_rad_per_s") else 0.0 for name in names])
    return PhysicalPriors.of(priors, list(effects), names, nulls)


def test_absence_costs_what_the_null_value_deviates():
    priors = physical([LATENCY, DELAY, RATE])
    assert priors.loss(np.empty(0)) == pytest.approx(8.0**2 + 0.0 + 8.0**2)
    assert priors.terms(np.empty(0), 3).information.shape == (3, 3)


def test_presence_costs_what_the_estimate_deviates():
    priors = physical([LATENCY, DELAY], mocap_latency=["latency_s"], actuation_delay=["delay_s"])
    assert priors.loss(np.array([0.008, 0.0])) == pytest.approx(0.0)
    assert priors.loss(np.array([0.010, 0.003])) == pytest.approx(4.0 + 9.0)


def test_a_limit_has_its_prior_on_the_reciprocal():
    priors = physical([RATE], steering_rate_limit=["rate_rad_per_s"])
    assert priors.loss(np.array([8.0])) == pytest.approx(0.0)
    assert priors.loss(np.array([8.01])) == pytest.approx(0.01**2, rel=0.01)
    assert priors.loss(np.array([1e9])) == pytest.approx(8.0**2)


def test_variants_have_the_prior_of_their_effect():
    servos = physical([DELAY], actuation_delay_servos=["steering_s", "drive_s"])
    assert servos.loss(np.array([0.003, 0.001])) == pytest.approx(4.0)
    smoothing = physical([LATENCY], mocap_latency_smoothing=["latency_s", "time_constant_s"])
    assert smoothing.loss(np.array([0.0, 0.010])) == pytest.approx(4.0)


def test_a_variant_of_another_effect_with_the_quantity_has_the_prior_too():
    offset = physical([WHEELBASE], marker_offset_wheelbase=["forward_m", "left_m", "longer"])
    assert offset.loss(np.array([0.3, 0.2, 0.01])) == pytest.approx(4.0)


def test_a_variant_without_the_quantity_is_not_judged():
    braking = Prior("speed_lag", "brake_s", 0.3, 0.01, "stop watch")
    ramp = physical([braking], speed_lag_ramp=["acceleration_mps2", "braking_mps2"])
    assert ramp.loss(np.array([1.0, 2.0])) == 0.0
    assert physical([braking]).loss(np.empty(0)) == pytest.approx(900.0)


@given(seed=st.integers(0, 1000))
def test_the_gradient_is_minus_half_the_derivative_of_the_loss(seed):
    rng = np.random.default_rng(seed)
    effects = {
        "mocap_latency_smoothing": ["latency_s", "time_constant_s"],
        "steering_rate_limit": ["rate_rad_per_s"],
        "actuation_delay": ["delay_s"],
    }
    priors = physical([LATENCY, DELAY, RATE], **effects)
    own, along = rng.uniform([0.0, 0.0, 2.0, 0.0], [0.1, 0.1, 20.0, 0.1]), rng.normal(size=4)
    terms, step = priors.terms(own, 2), 1e-7
    slope = (priors.loss(own + step * along) - priors.loss(own - step * along)) / (2.0 * step)
    assert -2.0 * terms.gradient[2:] @ along == pytest.approx(slope, rel=1e-4, abs=1e-2)
    assert not terms.gradient[:2].any()
    assert np.all(np.linalg.eigvalsh(terms.information) > -1e-6 * np.abs(terms.information).max())


@pytest.fixture(scope="module")
def batch():
    """Return a few runs of a vehicle that obeys 20 ms late."""
    runs = [run for run in campaign_runs(Tiny(delay_s=0.02)) if run.experiment in {"step", "trajectory"}][:12]
    return Batch(read_runs(runs, NEUTRAL_COMMAND), nodal_maps(runs, NEUTRAL_COMMAND), HEADER.geometry)


def start_of(batch):
    nominal = nominal_model("tiny", HEADER.geometry, Channels.alike("us"))
    return np.concatenate([getattr(nominal, role)(batch.maps.nodes[role]) for role in ROLES])


def test_the_gradient_of_the_penalised_objective_is_that_of_finite_differences(batch):
    predictor = Predictor(batch.with_priors((LATENCY, DELAY)), ("mocap_latency", "actuation_delay"))
    solver = LevenbergMarquardt(predictor, bounds_of(predictor.effects))
    parameters = np.r_[start_of(batch), 0.012, 0.015]
    state = FitState(parameters, np.zeros((len(batch.readings), 6)), initial_variance_components())
    at = solver.evaluate(state)
    gradient = at.terms.gradient.sum(axis=0) + at.prior.gradient
    for k in (-2, -1):
        step = np.zeros(len(parameters))
        step[k] = 2e-4
        more, less = (solver.evaluate(replace(state, parameters=parameters + sign * step)).loss for sign in (1.0, -1.0))
        assert -2.0 * gradient[k] == pytest.approx((more - less) / 4e-4, rel=0.02)


def fitted(batch, priors, effects=()):
    predictor = Predictor(batch.with_priors(priors), effects)
    start = np.r_[start_of(batch), np.full(len(predictor.parameter_names), 0.01)]
    return fit(predictor, start, bounds_of(effects), iterations=20)


def test_the_predicted_gain_includes_the_prior(batch):
    gains = {}
    for priors in ((), (LATENCY,)):
        known = fitted(batch, priors, ("actuation_delay",))
        larger = Predictor(known.predictor.batch, ("actuation_delay", "mocap_latency"))
        gains[priors] = first_order_gain(known, larger, np.array([0.005]), bounds_of(("mocap_latency",)))
        with_it = fitted(batch, priors, ("actuation_delay", "mocap_latency"))
        assert gains[priors] == pytest.approx(known.total_loss - with_it.total_loss, abs=6.0)
    # A delay and a latency are the same in these runs, so that the prior is all that there is to gain.
    assert gains[(LATENCY,)] - gains[()] == pytest.approx(64.0, abs=8.0)


def test_a_prior_divides_what_runs_cannot_divide(batch):
    both = fitted(batch, (LATENCY,), ("actuation_delay", "mocap_latency"))
    values = both.effect_values()
    assert values["mocap_latency.latency_s"] == pytest.approx(0.008, abs=5e-4)
    assert values["actuation_delay.delay_s"] == pytest.approx(0.012, abs=2e-3)
    error = standard_errors(both, both.predictor.readings.group)[-2:]
    assert error == pytest.approx(0.001, rel=0.3)


@pytest.mark.parametrize("deviation", [0.01, 0.2, 5.0])
def test_standard_errors_reflect_the_prior(deviation):
    """A line through nothing, whose slope was measured before: estimates scatter as their standard errors say."""
    rng, group = np.random.default_rng(2), np.arange(40)
    values, errors = [], []
    for _ in range(400):
        slopes, prior = rng.uniform(0.5, 2.0, 40), 1.0 + deviation * rng.normal()
        missed = slopes + rng.normal(size=40)
        information = float(slopes @ slopes) + deviation**-2
        value = float(slopes @ missed + prior / deviation**2) / information
        one = SimpleNamespace(
            predictor=SimpleNamespace(readings=SimpleNamespace(initial_states=None)),
            gradient=(slopes * (missed - slopes * value))[:, None],
            information=every_parameter((slopes**2)[:, None, None]),
            total_information=np.array([[information]]),
            covariance=np.array([[1.0 / information]]),
            covariance_by_priors=np.array([[(1.0 / information / deviation) ** 2]]),
        )
        values.append(value)
        errors.append(float(standard_errors(one, group)[0]))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(values), rel=0.2)
