"""A wheelbase that a lab measured a few millimetres too short is named, and not the scale of its camera alone."""

from __future__ import annotations

import pytest
from tiny_vehicle import FRONT_M, REAR_M, Tiny

from agvbench.diagnosis import diagnose

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("error_m", [0.004, -0.004])
def test_a_wheelbase_that_was_measured_wrongly_is_named(tiny_campaign, error_m):
    true_m = FRONT_M + REAR_M + error_m
    (effect,) = diagnose(tiny_campaign(Tiny(wheelbase_m=true_m))).effects
    assert "wheelbase_error" in {effect.name, *effect.confounded_with}
    estimate = next(iter(effect.parameters.values()))  # a scale of the camera has the same size
    share = error_m / (FRONT_M + REAR_M)
    assert estimate.value == pytest.approx(share, abs=max(3.0 * estimate.stderr, 0.1 * abs(share)))


@pytest.mark.parametrize("error_m", [0.008, -0.008])
def test_a_scale_of_the_camera_is_an_alternative_but_for_a_fraction_of_a_millimetre(tiny_campaign, error_m):
    """A scale moves the markers, too: where precise runs tell the two apart, they tell a place that is not measured."""
    (effect,) = diagnose(tiny_campaign(Tiny(wheelbase_m=FRONT_M + REAR_M + error_m))).effects
    assert {"wheelbase_error", "mocap_scale"} <= {effect.name, *effect.confounded_with}
