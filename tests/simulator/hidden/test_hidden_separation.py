"""What is hidden is visible, or said not to be; rivals are found by driving plants."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.simulator.hidden import SeparationStudy, make_hidden_plant, separation
from agvbench.simulator.hidden.catalogue import CATALOGUE
from agvbench.simulator.hidden.sampling import FLOORS, vehicle_of
from agvbench.simulator.hidden.separation import fit_recipe


@pytest.fixture(scope="module")
def bench():
    return SeparationStudy(vehicle_of(5))


def explained(bench, hidden, candidate, **sizes):
    """What a candidate leaves of a hidden effect [floors]."""
    wanted = np.concatenate(bench.paths(CATALOGUE[hidden].constants(sizes)))
    return fit_recipe(bench, wanted, CATALOGUE[candidate]) / bench.floor_m


def test_floor_is_the_noise_of_the_camera_and_the_play_of_runs(bench):
    assert 0.0003 < bench.floor_m < 0.003


def test_nothing_is_not_visible(bench):
    found = separation(bench, {})
    assert found.refitted == found.held == 0.0


def test_what_maps_take_up_is_visible_only_while_they_are_held(bench):
    """Driving 5 % slower is a drive map of another slope."""
    slower = separation(bench, {"gain_forward": 0.95 * bench._constants["gain_forward"]})
    assert slower.held > 10.0
    assert slower.refitted < 0.01


def test_droop_is_left_when_maps_are_refitted(bench):
    """The mean of the session's droop is a scale of the map; its course is not."""
    found = separation(bench, {"droop": 0.1})
    assert found.held > found.refitted > FLOORS


def test_a_delay_explains_a_latency_and_a_slip_does_not(bench):
    assert explained(bench, "mocap_latency", "actuation_delay", latency_s=0.1) < 0.3
    assert explained(bench, "mocap_latency", "mocap_latency", latency_s=0.13) < 0.01
    assert explained(bench, "mocap_latency", "lateral_slip", latency_s=0.1) > FLOORS


@pytest.mark.parametrize("spec", ["reverse_steering_gain", "heading_misalignment"])
def test_hidden_sizes_leave_three_floors(spec):
    truth = make_hidden_plant(spec, 5).sealed_truth()
    assert (truth.separation_unfitted if truth.absorbed else truth.separation) >= FLOORS
    assert truth.absorbed == (spec == "heading_misalignment")


def test_reference_straights_are_two_metres_long(bench):
    straight = bench.base_path[0]
    assert np.hypot(*(straight[-1] - straight[0])[:2]) == pytest.approx(2.0, abs=0.01)
