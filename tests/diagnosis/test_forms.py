"""A cause keeps its name where its law is another than the library's, and a vehicle keeps the law it is known by."""

from __future__ import annotations

import pytest
from tiny_vehicle import InMemory, Tiny, campaign_runs

from agvbench.diagnosis import Verdict, diagnose


@pytest.mark.slow
def test_a_servo_of_second_order_is_a_steering_lag(tiny_campaign):
    campaign = tiny_campaign(Tiny(steering_lag_s=0.18, steering_inertia_s=0.1))
    found = diagnose(campaign)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("steering_lag", "steering_lag_inertia")
    assert effect.parameters["time_constant_s"].value == pytest.approx(0.18, rel=0.05)
    assert effect.parameters["inertia_s"].value == pytest.approx(0.1, rel=0.05)
    known = found.model.effect("steering_lag_inertia")

    again = diagnose(campaign, vehicle=found.model)
    assert again.verdict is Verdict.ADEQUATE
    assert again.effects == ()
    assert again.model.effect("steering_lag_inertia").inertia_s == pytest.approx(known.inertia_s, rel=0.02)
    position = again.held_out.errors["position_rms_mm"]
    assert position["before"] == pytest.approx(position["after"], rel=0.05)


@pytest.mark.slow
def test_a_backlash_has_a_width_at_each_axle():
    """With one width for both, the maps take up the difference, and other runs are predicted worse."""
    found = diagnose(InMemory(campaign_runs(Tiny(play_rad=0.04, rear_play_ratio=1.8), rear_steps=True)))
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("steering_backlash", "steering_backlash_uneven")
    assert effect.parameters["front_width_rad"].value == pytest.approx(0.04, rel=0.1)
    assert effect.parameters["rear_width_rad"].value == pytest.approx(0.072, rel=0.1)


@pytest.mark.slow
def test_an_elastic_drive_train_is_a_speed_lag_with_its_force_in_each_direction(tiny_campaign):
    found = diagnose(
        tiny_campaign(
            Tiny(ramp_forward_mps2=0.9, ramp_backward_mps2=0.6, is_ramp_of_force=True, coast_s=0.4, spring_per_s2=2.5)
        )
    )
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("speed_lag", "speed_lag_spring_back")
    for key, value in (("forward_mps2", 0.9), ("backward_mps2", 0.6), ("coast_s", 0.4), ("spring_per_s2", 2.5)):
        assert effect.parameters[key].value == pytest.approx(value, rel=0.1)


@pytest.mark.slow
def test_a_vehicle_that_dry_friction_stops_is_a_speed_lag_with_its_deceleration(tiny_campaign):
    """With one lag for all speeds, the slow vehicle would coast too far, and the fast one too little."""
    found = diagnose(tiny_campaign(Tiny(accelerate_s=0.15, brake_s=0.05, coast_mps2=0.8)))
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("speed_lag", "speed_lag_friction")
    assert effect.parameters["coast_mps2"].value == pytest.approx(0.8, rel=0.05)
    assert effect.parameters["accelerate_s"].value == pytest.approx(0.15, rel=0.1)


@pytest.mark.slow
def test_a_drive_with_a_lag_and_a_backlash_is_no_filter_of_the_camera(tiny_campaign):
    """Both round the speed off, which no limit of the force does, and a filter of the camera seems to."""
    train = {"ramp_forward_mps2": 1.1, "ramp_backward_mps2": 0.9, "coast_s": 0.3, "spring_per_s2": 2.5}
    found = diagnose(
        tiny_campaign(Tiny(**train, is_ramp_of_force=True, ramp_lag_s=0.08, drive_gap_m=0.012, steering_lag_s=0.1))
    )
    effects = {effect.name: effect for effect in found.effects}
    assert "mocap_latency" not in effects
    parameters = effects["speed_lag"].parameters
    assert parameters["lag_s"].value == pytest.approx(0.08, rel=0.25)
    assert parameters["backlash_m"].value == pytest.approx(0.012, rel=0.25)


@pytest.mark.slow
def test_an_axle_that_brakes_and_the_drag_of_turned_wheels_are_both_measured(tiny_campaign):
    """Drag acts against both axles at once: where it is large, none of them brakes."""
    found = diagnose(tiny_campaign(Tiny(overrun=2.0, cornering_loss=0.08)))
    values = {effect.name: effect.parameters for effect in found.effects}
    assert values["axle_overrun"]["excess"].value == pytest.approx(2.0, rel=0.15)
    assert values["cornering_speed_loss"]["loss"].value == pytest.approx(0.08, rel=0.1)


@pytest.mark.slow
def test_axles_that_share_a_differential_are_no_axle_that_brakes(tiny_campaign):
    """Both predict a lower speed where the axles steer differently; the differential's grows with the square of it."""
    found = diagnose(tiny_campaign(Tiny(has_differential=True)))
    assert {effect.name for effect in found.effects} == {"axle_differential"}
    assert found.effects[0].parameters["share"].value == pytest.approx(1.0, abs=0.15)
