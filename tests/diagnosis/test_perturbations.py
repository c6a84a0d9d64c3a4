"""Derivatives from variants of runs, against differences of whole predictions; and the sums that they take."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import FRONT_M, NEUTRAL, NEUTRAL_COMMAND, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import nodal_maps
from agvbench.diagnosis.model.perturbations import GroupedSums
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.vehicle.geometry import Geometry


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 3)), min_size=1, max_size=40))
def test_terms_that_belong_together_are_summed(places):
    one, other = np.array(places).T
    terms = np.random.default_rng(len(places)).normal(size=(len(places), 2, 3))
    expected = np.zeros((5, 4, 2, 3))
    np.add.at(expected, (one, other), terms)
    grouped = GroupedSums.of(one, other)
    found = np.zeros_like(expected)
    found[tuple(grouped.key.T)] = grouped.sums(terms)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)
    assert len(grouped.key) == len({*places})


@pytest.fixture(scope="module")
def predictor():
    readings = read_runs(campaign_runs(Tiny())).select(np.arange(0, 40, 4))
    maps = nodal_maps(readings.runs, NEUTRAL_COMMAND)
    batch = Batch(readings, maps, Geometry(FRONT_M, REAR_M))
    assert not batch.perturbations.by_node
    return Predictor(batch, ("steering_lag",))


@pytest.fixture
def values(predictor):
    maps = predictor.maps
    steering = [-0.0008 * (maps.nodes[role] - NEUTRAL) for role in ("front", "rear")]
    return np.r_[steering[0], -0.5 * steering[1], 0.0006 * (maps.nodes["drive"] - NEUTRAL), 0.1]


def test_slopes_by_levels_are_those_of_whole_maps_and_of_each_runs_offsets(predictor, values):
    rng = np.random.default_rng(3)
    random_effects = rng.normal(size=(len(predictor.readings), 6)) * [0.01, 0.01, 0.1, 0.05, 0.05, 0.2]
    slopes = predictor.linearise(values, random_effects)
    way = rng.normal(size=len(values)) * 1e-4
    there, back = predictor.predict(values + way, random_effects), predictor.predict(values - way, random_effects)
    np.testing.assert_allclose((there - back) / 2.0, slopes.by_parameters @ way, atol=1e-6)
    way = rng.normal(size=random_effects.shape) * 1e-4
    there, back = predictor.predict(values, random_effects + way), predictor.predict(values, random_effects - way)
    expected = np.einsum("rkcj,rj->rkc", slopes.by_random_effects, way)
    np.testing.assert_allclose((there - back) / 2.0, expected, atol=1e-6)


@pytest.mark.parametrize("moved", ["map", "effect", "start"])
def test_what_was_predicted_last_is_kept_for_the_same_question_only(predictor, values, moved):
    none = predictor.no_random_effects()
    first = predictor.predict(values, none).copy()
    assert predictor.predict(values, none) is predictor.predict(values.copy(), none.copy())
    others, random_effects = values.copy(), none.copy()
    {"map": others[:1], "effect": others[-1:], "start": random_effects[:, :1]}[moved][...] += 0.01
    fresh = Predictor(predictor.batch, predictor.effects)
    np.testing.assert_array_equal(predictor.predict(others, random_effects), fresh.predict(others, random_effects))
    assert np.nanmax(np.abs(predictor.predict(others, random_effects) - first)) > 1e-5
    np.testing.assert_array_equal(predictor.predict(values, none), first)
