"""Verdicts on a vehicle whose truth is known, driven by formulas that are not the package's."""

from __future__ import annotations

import pytest
from tiny_vehicle import Tiny

from agvbench.diagnosis import Verdict, diagnose


def test_what_free_maps_describe_is_adequate(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny()))
    assert found.verdict is Verdict.ADEQUATE
    assert found.effects == ()
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] == pytest.approx(position["floor"], rel=0.25)


def test_a_steering_lag_is_named_with_its_size(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(steering_lag_s=0.15)))
    assert found.verdict is Verdict.NAMED
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    estimate = found.effects[0].parameters["time_constant_s"]
    assert abs(estimate.value - 0.15) < 4.0 * estimate.stderr + 1e-3
    position = found.held_out.errors["position_rms_mm"]
    assert position["before"] > 5.0 * position["floor"]
    assert position["after"] < 1.25 * position["floor"]
    assert found.model.effect("steering_lag").time_constant_s == pytest.approx(0.15, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tiny", "name", "parameters"),
    [
        (Tiny(droop_per_hour=0.05), "battery_droop", {"per_hour": 0.05}),
        (Tiny(tilt_mps=0.004, tilt_rad=1.0), "floor_tilt", {"drift_mps": 0.004, "direction_rad": 1.0}),
        (Tiny(slip=0.8), "lateral_slip", {"gradient": 0.8}),
        (Tiny(accelerate_s=0.3, brake_s=0.5), "speed_lag", {"accelerate_s": 0.3, "brake_s": 0.5}),
        (
            Tiny(front_from_rear=0.04, rear_from_front=-0.02),
            "axle_coupling",
            {"front_from_rear": 0.04, "rear_from_front": -0.02},
        ),
        (Tiny(cornering_loss=0.05), "cornering_speed_loss", {"loss": 0.05}),
        (Tiny(reverse_gain=0.04), "reverse_steering_gain", {"gain": 0.04}),
        # The maps take up most of it, and give it back along a bend that whole steps leave.
        (Tiny(axle_ratio=0.3), "axle_speed_mismatch", {"ratio": 0.3}),
    ],
)
def test_an_effect_is_named_with_its_size(tiny_campaign, tiny, name, parameters):
    found = diagnose(tiny_campaign(tiny))
    assert found.verdict is Verdict.NAMED
    assert [effect.name for effect in found.effects] == [name]
    for key, value in parameters.items():
        estimate = found.effects[0].parameters[key]
        assert 0.0 < estimate.stderr < 0.25 * abs(value)
        assert abs(estimate.value - value) < 4.0 * estimate.stderr + 0.02 * abs(value)


@pytest.mark.slow
def test_a_delay_cannot_be_told_from_a_latency_of_the_cameras_between_rests(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(delay_s=0.1)))
    assert found.verdict is Verdict.AMBIGUOUS
    (effect,) = found.effects
    assert {effect.name, *effect.confounded_with} == {"actuation_delay", "mocap_latency"}


@pytest.mark.slow
def test_two_effects_are_both_named(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(steering_lag_s=0.12, slip=0.8)))
    assert found.verdict is Verdict.NAMED
    assert {effect.name for effect in found.effects} == {"steering_lag", "lateral_slip"}


@pytest.mark.slow
def test_a_slow_patch_of_floor_is_unknown_and_depends_on_place(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(slow_patch=0.1)))
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects == ()
    assert found.significant
    assert {d.covariate for d in found.depends_on[:2]} == {"x_m", "y_m"}
    assert found.depends_on[0].feature == "speed"


def test_without_repeats_there_is_no_floor_and_no_verdict(tiny_campaign):
    campaign = tiny_campaign(Tiny())
    once = type(campaign)([run for run in campaign if run.repeat == 1])
    found = diagnose(once)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "repeatability cannot be estimated" in found.why
    assert found.held_out is None


def test_a_vehicle_that_never_turned_says_nothing_about_steering(tiny_campaign):
    campaign = tiny_campaign(Tiny())
    straight = [run for run in campaign if run.experiment == "drive"]
    found = diagnose(type(campaign)(straight))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "steering" in found.why


@pytest.mark.slow
def test_an_effect_that_the_vehicle_is_known_to_have_is_not_named_again(tiny_campaign):
    campaign = tiny_campaign(Tiny(steering_lag_s=0.15))
    corrected = diagnose(campaign).model
    again = diagnose(campaign, vehicle=corrected)
    assert again.verdict is Verdict.ADEQUATE
    assert again.effects == ()
    assert again.model.effect("steering_lag").time_constant_s == pytest.approx(0.15, rel=0.03)
    position = again.held_out.errors["position_rms_mm"]
    assert position["before"] == pytest.approx(position["after"], rel=0.05)
