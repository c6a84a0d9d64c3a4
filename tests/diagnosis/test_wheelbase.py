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
