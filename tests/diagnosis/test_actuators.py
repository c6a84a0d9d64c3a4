"""Actuators against a latency of the camera: whichever explains the runs, and never a filter for slow actuators."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tiny_selector import selector_of
from tiny_vehicle import FRONT_M, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis import runs_from_rest
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.diagnosis.selection.actuators import CAMERA, prefer_actuators, separate_lag_from_delay
from agvbench.diagnosis.selection.sequential_replacement import replace_sequentially
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import continued, with_extended_library
from agvbench.effects.variants import cause_of

SLOW = Tiny(delay_s=0.06, steering_lag_s=0.1, accelerate_s=0.15, brake_s=0.25)


def selected(tiny: Tiny, *names: str) -> tuple[Selection, Selector]:
    """Return a selection of the effects `names`, fitted to the runs of a vehicle, with its selector."""
    selector = selector_of(campaign_runs(tiny))
    extended = with_extended_library(selector)
    base = current = extended.base()
    for name in names:
        current = extended.with_effect(current, name)
    gains = {name: extended.without_effect(base, current, name).deviance - current.deviance for name in names}
    return Selection(base, current, {}, gains, {}, 0), selector


@pytest.mark.slow
def test_slow_actuators_take_the_place_of_a_filter_of_the_camera():
    selection, selector = selected(SLOW, "speed_lag", "mocap_latency_smoothing")
    found = prefer_actuators(selection, selector)
    assert {cause_of(name) for name in found.chosen.names} == {"actuation_delay", "steering_lag", "speed_lag"}
    values = found.chosen.fit.effect_values()
    assert values["actuation_delay.delay_s"] == pytest.approx(0.06, abs=0.01)
    assert values["steering_lag.time_constant_s"] == pytest.approx(0.1, abs=0.02)
    assert found.chosen.deviance < selection.chosen.deviance
    assert all(CAMERA not in others for others in found.alternatives.values())


@pytest.mark.slow
def test_without_a_latency_of_the_camera_nothing_is_fitted():
    selection, selector = selected(replace(SLOW, delay_s=0.0), "speed_lag", "steering_lag")
    tried = selector.tried
    assert prefer_actuators(selection, selector) is selection
    assert selector.tried == tried


@pytest.mark.slow
def test_servos_of_which_one_is_slower_have_a_lag_each_and_a_common_delay():
    selection, selector = selected(replace(SLOW, rear_lag_ratio=1.8), "speed_lag", "actuation_delay_uneven")
    found = separate_lag_from_delay(selection, selector)
    assert {*found.chosen.names} == {"speed_lag", "actuation_delay", "steering_lag_uneven"}
    values = found.chosen.fit.effect_values()
    assert values["actuation_delay.delay_s"] == pytest.approx(0.06, abs=0.01)
    assert values["steering_lag_uneven.time_constant_s"] == pytest.approx(0.1, abs=0.02)
    assert values["steering_lag_uneven.rear_ratio"] == pytest.approx(1.8, rel=0.1)


@pytest.mark.slow
def test_equal_lags_of_servos_and_drive_are_no_delay_of_all():
    tiny = Tiny(steering_lag_s=0.06, accelerate_s=0.06, brake_s=0.06)
    selection, selector = selected(tiny, "actuation_delay_servos")
    found = separate_lag_from_delay(selection, selector)
    assert {*found.chosen.names} == {"steering_lag", "speed_lag"}
    values = found.chosen.fit.effect_values()
    assert values["steering_lag.time_constant_s"] == pytest.approx(0.06, abs=0.005)
    assert values["speed_lag.accelerate_s"] == pytest.approx(0.06, abs=0.005)


@pytest.mark.slow
def test_beside_the_right_actuators_the_selection_continues():
    """A delay of all actuators resembles lags of them, and leaves no gain to a small offset of the markers."""
    tiny = Tiny(steering_lag_s=0.06, accelerate_s=0.06, brake_s=0.06, marker_forward_m=0.004)
    before, selector = selected(tiny, "actuation_delay_servos")
    found = continued(separate_lag_from_delay(before, selector), before, selector)
    assert {cause_of(name) for name in found.chosen.names} == {"steering_lag", "speed_lag", "marker_offset"}
    assert continued(found, found, selector) is found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tiny", "names"),
    [
        (Tiny(delay_s=0.1), ("actuation_delay",)),
        (Tiny(steering_lag_s=0.15), ("steering_lag",)),
    ],
)
def test_a_delay_or_a_lag_alone_stays_what_it_is(tiny, names):
    selection, selector = selected(tiny, *names)
    found = separate_lag_from_delay(selection, selector)
    assert found.chosen.names == selection.chosen.names
    assert not any(found.alternatives.values())


@pytest.mark.slow
def test_an_effect_that_another_explains_better_is_replaced():
    selection, selector = selected(Tiny(cornering_loss=0.15), "axle_overrun")
    found = replace_sequentially(selection, selector)
    assert found.chosen.names == ("cornering_speed_loss",)
    assert found.chosen.deviance < selection.chosen.deviance


@pytest.mark.slow
def test_after_a_replacement_the_selection_continues(monkeypatch):
    """What hid behind the effect that was replaced is found, too."""
    tiny = Tiny(cornering_loss=0.15, marker_forward_m=0.01)
    selection, selector = selected(tiny, "axle_overrun")
    monkeypatch.setattr(selector, "select", lambda: selection)
    monkeypatch.setattr(runs_from_rest, "select_variants_and_reconsider", lambda *both: both)
    found, _ = RunsFromRest._selected_effects(selector)
    assert {cause_of(name) for name in found.chosen.names} == {"cornering_speed_loss", "marker_offset"}


@pytest.mark.slow
def test_a_variant_replaces_an_effect_that_resembles_only_one_of_the_two_that_it_combines():
    """The offset of the markers is small: the library's equation for it alone gains nothing."""
    tiny = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.006, marker_forward_m=-0.0015, noise_m=1e-4, noise_rad=3e-4)
    selection, selector = selected(tiny, "mocap_scale")
    found = replace_sequentially(selection, selector)
    assert found.chosen.names == ("marker_offset_wheelbase",)
    values = found.chosen.fit.effect_values()
    assert values["marker_offset_wheelbase.forward_m"] == pytest.approx(-0.0015, abs=0.0003)


@pytest.mark.slow
def test_a_variant_that_gains_nothing_gives_way_to_the_librarys_equation():
    selection, selector = selected(Tiny(steering_lag_s=0.1), "steering_lag_inertia")
    selection = replace(selection, alternatives={"steering_lag_inertia": {"actuation_delay": 3.0}})
    found = replace_sequentially(selection, selector)
    assert found.chosen.names == ("steering_lag",)
    assert found.gains.keys() == found.alternatives.keys() == {"steering_lag"}


@pytest.mark.slow
def test_beside_a_variant_the_selection_continues():
    tiny = Tiny(steering_lag_s=0.1, steering_inertia_s=0.06, marker_forward_m=0.01)
    selection, selector = selected(tiny, "steering_lag_inertia")
    found = continued(selection, selection, selector)
    assert {*found.chosen.names} == {"steering_lag_inertia", "marker_offset"}
    plain, selector = selected(Tiny(steering_lag_s=0.1, marker_forward_m=0.01), "steering_lag")
    assert continued(plain, plain, selector) is plain


@pytest.mark.slow
def test_maps_that_an_effect_distorted_are_fitted_again_without_it():
    tiny = Tiny(accelerate_s=0.2, brake_s=0.2, cornering_loss=0.15)
    selection, selector = selected(tiny, "speed_lag", "cornering_speed_loss")
    extended = with_extended_library(selector)
    chosen, base = selection.chosen, selection.base
    parameters = chosen.fit.parameters.copy()
    speeds = extended.batch.maps.slices()["drive"]
    parameters[speeds] *= 20.0
    distorted = replace(chosen, fit=replace(chosen.fit, parameters=parameters), starts=frozenset({("else", b"1")}))
    without = extended.without_effect(base, distorted, "cornering_speed_loss")
    wanted = extended.with_effect(base, "speed_lag")
    assert without.fit.total_loss == pytest.approx(wanted.fit.total_loss, abs=5.0)
