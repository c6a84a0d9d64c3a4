"""Derivatives of repeats are those of the run that represents them, turned to their start pose, if both are alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import FRONT_M, NEUTRAL, NEUTRAL_COMMAND, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import nodal_maps
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.model.repeats import Repeats
from agvbench.effects import effect_kinds
from agvbench.vehicle.geometry import Geometry


@pytest.fixture(scope="module")
def readings():
    every = read_runs(campaign_runs(Tiny()))
    return every.select(np.isin(every.group, np.unique(every.group)[:6]))


def predictors(readings, *names):
    """Return the predictor of the runs, and one that simulates each of them."""
    both = []
    for repeats in (None, Repeats(np.arange(len(readings)))):
        batch = Batch(readings, nodal_maps(readings.runs, NEUTRAL_COMMAND), Geometry(FRONT_M, REAR_M))
        batch.repeats = repeats or batch.repeats
        both.append(Predictor(batch, names))
    return both


def values_of(predictor, *own):
    nodes = predictor.maps.nodes
    steering = [-0.0008 * (nodes[role] - NEUTRAL) for role in ("front", "rear")]
    return np.r_[steering[0], -0.5 * steering[1], 0.0006 * (nodes["drive"] - NEUTRAL), own]


def scattered(readings, seed=0):
    scatter = np.array([1e-3, 1e-3, 0.01, 0.002, 0.002, 0.005])
    return np.random.default_rng(seed).normal(size=(len(readings), 6)) * scatter


def test_runs_with_equal_commands_are_represented_by_their_first(readings):
    representative = Repeats.of(readings).representative
    for group in np.unique(readings.group):
        own = np.flatnonzero(readings.group == group)
        assert {*representative[own].tolist()} == {own[0]}


def test_a_repeat_that_was_sampled_at_other_times_represents_itself(readings):
    t_s = readings.t_s.copy()
    last = int(np.flatnonzero(readings.group == readings.group[0])[-1])
    t_s[last] += 0.05
    assert Repeats.of(replace(readings, t_s=t_s)).representative[last] == last


@pytest.mark.parametrize("name", ["steering_lag", "actuation_delay", "heading_misalignment", "cornering_speed_loss"])
def test_derivatives_of_repeats_are_those_of_a_simulation_of_each(readings, name):
    few, every = predictors(readings, name)
    values = values_of(few, *[parameter.scale for parameter in effect_kinds()[name].parameters()])
    random_effects = scattered(readings)
    fast, exact = (one.linearise(values, random_effects) for one in (few, every))
    assert len(few.batch.repeats.simulated) < 0.5 * len(readings)
    for part in ("by_own", "by_random_effects"):
        found, truth = getattr(fast, part), getattr(exact, part)
        assert np.sqrt(np.mean((found - truth) ** 2)) < 0.05 * np.sqrt(np.mean(truth**2))


def test_the_pose_with_one_more_effect_is_that_without_it_and_the_motion_of_its_representative(readings):
    without, _ = predictors(readings)
    few, every = predictors(readings, "steering_lag")
    random_effects, values = scattered(readings), values_of(few)
    near = without.predict(values, random_effects)
    (found, slopes), (truth, exact) = (one.by_last(np.r_[values, 0.1], random_effects, 1, near) for one in (few, every))
    assert np.max(np.abs(found - truth)) < 0.03 * np.max(np.abs(truth - near))
    assert np.max(np.abs(slopes - exact)) < 0.05 * np.max(np.abs(exact))


def test_repeats_that_random_effects_drive_apart_are_simulated_each(readings):
    """Speeds that differ by a fifth, as over an evening: their derivatives differ as much."""
    few, every = predictors(readings, "steering_lag")
    random_effects = scattered(readings)
    random_effects[:, 5] = np.linspace(-0.4, 0.4, len(readings))
    values = values_of(few, 0.1)
    fast, exact = (one.linearise(values, random_effects).by_own for one in (few, every))
    np.testing.assert_allclose(fast, exact, atol=0.03 * np.max(np.abs(exact)))


@pytest.mark.parametrize("name", ["battery_droop", "floor_tilt", "mocap_scale"])
def test_what_acts_by_place_or_campaign_time_is_simulated_for_each_run(readings, name):
    kind = effect_kinds()[name]
    few, every = predictors(readings, name)
    values = values_of(few, *[parameter.scale for parameter in kind.parameters()])
    fast, exact = (one.linearise(values, scattered(readings)) for one in (few, every))
    assert not kind.acts_alike_on_repeats()
    for parameter, slope in exact.by_effects().items():
        np.testing.assert_array_equal(fast.by_effects()[parameter], slope)


@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_a_change_is_turned_with_the_vehicle(first, second):
    change = np.array([[[0.3, 0.1, 0.02]], [[0.3, 0.1, 0.02]]])
    turned = Repeats(np.array([0, 0])).turned(change, np.array([0, 1]), np.array([first, second]))
    np.testing.assert_allclose(turned[0], change[0], atol=1e-12)
    expected = complex(0.3, 0.1) * np.exp(1j * (second - first))
    np.testing.assert_allclose(turned[1, 0], [expected.real, expected.imag, 0.02], atol=1e-12)
