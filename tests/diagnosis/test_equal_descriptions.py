"""A variant's further parameters may stand for another effect: it is said that the runs do not tell them apart."""

from __future__ import annotations

import pytest
from tiny_selector import selector_of
from tiny_vehicle import FRONT_M, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis.selection.equal_descriptions import with_equal_descriptions
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import with_extended_library

pytestmark = pytest.mark.slow


def alternatives(tiny: Tiny, variant: str, *before: str) -> dict[str, float]:
    """Return the alternatives of a variant that took the place of the effects `before`."""
    selector = selector_of(campaign_runs(tiny))
    extended = with_extended_library(selector)
    base = larger = extended.base()
    for name in before:
        larger = extended.with_effect(larger, name)
    chosen = extended.with_effect(base, variant)
    selection = Selection(base, chosen, {}, {variant: base.deviance - chosen.deviance}, {}, 0)
    return with_equal_descriptions(selection, larger, selector).alternatives.get(variant, {})


def test_what_all_delays_of_actuators_have_in_common_may_be_the_cameras():
    assert abs(alternatives(Tiny(delay_s=0.06), "actuation_delay_servos")["mocap_latency"]) < 1.0


def test_delays_with_nothing_in_common_are_not_the_cameras():
    """The servos alone are late: a delay of the steering of 60 ms, and none of the drive."""
    tiny = Tiny(steering_lag_s=0.06)
    assert "mocap_latency" not in alternatives(tiny, "actuation_delay_servos")


def test_a_wheelbase_beside_displaced_markers_may_be_a_scale_of_the_camera():
    tiny = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.006, marker_forward_m=0.01)
    assert "mocap_scale" in alternatives(tiny, "marker_offset_wheelbase", "mocap_scale")


def test_an_effect_that_explains_the_runs_worse_is_no_alternative():
    tiny = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.006, marker_forward_m=0.01)
    assert alternatives(tiny, "marker_offset_wheelbase", "lateral_slip") == {}
