"""A variant's further parameters may stand for another effect: it is said that the runs do not tell them apart."""

from __future__ import annotations

import pytest
from tiny_selector import selector_of
from tiny_vehicle import FRONT_M, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis.selection.equal_descriptions import with_equal_descriptions
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import with_extended_library

pytestmark = pytest.mark.slow


WRONG_DISTANCES = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.006, marker_forward_m=0.01)


def alternatives(
    tiny: Tiny, variant: str, *before: str, known: tuple[str, ...] = (), beside: tuple[str, ...] = ()
) -> dict[str, float]:
    """Return the alternatives of an effect that took the place of the effects `before`, beside the `known` ones.

    The model has the effects `beside` as well.
    """
    selector = selector_of(campaign_runs(tiny))
    extended = with_extended_library(selector)
    base = larger = extended.base()
    for name in beside:
        base = larger = extended.with_effect(base, name)
    for name in before:
        larger = extended.with_effect(larger, name)
    chosen = extended.with_effect(base, variant)
    gains = {variant: base.deviance - chosen.deviance}
    selection = Selection(extended.base(), chosen, {variant: dict.fromkeys(known, 0.0)}, gains, {}, 0)
    return with_equal_descriptions(selection, larger, selector).alternatives.get(variant, {})


def test_what_all_delays_of_actuators_have_in_common_may_be_the_cameras():
    assert abs(alternatives(Tiny(delay_s=0.06), "actuation_delay_servos")["mocap_latency"]) < 1.0


def test_delays_with_nothing_in_common_are_not_the_cameras():
    """The servos alone are late: a delay of the steering of 60 ms, and none of the drive."""
    tiny = Tiny(steering_lag_s=0.06)
    assert "mocap_latency" not in alternatives(tiny, "actuation_delay_servos")


def test_a_wheelbase_beside_displaced_markers_may_be_a_scale_of_the_camera():
    found = alternatives(WRONG_DISTANCES, "marker_offset_wheelbase", "mocap_scale")
    assert {"mocap_scale", "wheelbase_error"} <= found.keys()


def test_a_scale_is_an_alternative_also_where_it_was_not_selected_before():
    found = alternatives(WRONG_DISTANCES, "marker_offset_wheelbase", "lateral_slip")
    assert "mocap_scale" in found
    assert "lateral_slip" not in found


def test_two_wrong_distances_may_stand_for_a_coupling_of_the_axles():
    """Both describe that each axle turns the vehicle as if it were somewhere else."""
    found = alternatives(WRONG_DISTANCES, "axle_coupling", known=("marker_offset",))
    assert {"marker_offset", "mocap_scale", "wheelbase_error"} <= found.keys()


def test_without_displaced_markers_among_its_alternatives_a_coupling_is_not_divided():
    assert alternatives(WRONG_DISTANCES, "axle_coupling") == {}


def test_lengths_are_compared_beside_a_variant_of_another_effect():
    tiny = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.006, play_rad=0.03)
    assert "mocap_scale" in alternatives(tiny, "wheelbase_error", beside=("steering_backlash_uneven",))
