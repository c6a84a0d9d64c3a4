"""States of effects on a vehicle whose truth is known: bounds hold the true values, and are not trivial."""

from __future__ import annotations

import pytest
from tiny_vehicle import Tiny

from agvbench.diagnosis import diagnose
from agvbench.diagnosis.result import State
from agvbench.effects import effect_kinds


@pytest.fixture(scope="module")
def nothing(tiny_campaign):
    return diagnose(tiny_campaign(Tiny()))


def test_every_effect_of_the_library_has_a_state(nothing):
    assert set(nothing.states) == {name for name, kind in effect_kinds().items() if not kind.needs_differential}
    assert State.PRESENT not in {effect.state for effect in nothing.states.values()}


def test_bounds_of_absent_effects_are_below_their_usual_size(nothing):
    kinds = effect_kinds()
    for name in ("actuation_delay", "steering_lag", "lateral_slip", "floor_tilt", "battery_droop", "marker_offset"):
        state = nothing.states[name]
        assert state.state is State.ABSENT
        scales = {p.name: p.scale for p in kinds[name].parameters()}
        assert state.bounds
        assert all(0.0 < bound.value < scales[key] for key, bound in state.bounds.items())


def test_a_limit_is_bounded_from_below(nothing):
    bound = nothing.states["steering_rate_limit"].bounds["rate_rad_per_s"]
    assert bound.is_limit
    assert bound.value > 1.0


def test_what_maps_absorb_is_not_identifiable(nothing):
    assert nothing.states["drive_dead_band"].state is State.NOT_IDENTIFIABLE
    assert "calibration" in nothing.states["drive_dead_band"].why


@pytest.mark.slow
def test_an_effect_too_small_to_be_selected_is_within_its_bound(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(play_rad=0.02)))
    assert found.effects == ()
    assert found.states["steering_backlash"].bounds["width_rad"].value > 0.02


@pytest.mark.slow
def test_steering_that_never_changes_while_driving_cannot_exclude_a_lag(tiny_campaign):
    campaign = tiny_campaign(Tiny())
    steady = type(campaign)([run for run in campaign if run.experiment != "step"])
    state = diagnose(steady).states["steering_lag"]
    whole = diagnose(campaign).states["steering_lag"]
    assert (
        state.state is State.NOT_IDENTIFIABLE
        or state.bounds["time_constant_s"].value > 3.0 * whole.bounds["time_constant_s"].value
    )


@pytest.mark.slow
def test_an_alternative_cannot_be_told_from_the_named_effect(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(delay_s=0.1)))
    (named,) = found.effects
    (other,) = {"actuation_delay", "mocap_latency"} - {named.name}
    assert found.states[named.name].state is State.PRESENT
    assert found.states[other].state is State.NOT_IDENTIFIABLE
    assert found.states[other].indistinguishable_from == (named.name,)
    frame = found.states_frame().set_index("effect")
    assert frame.loc[other, "indistinguishable_from"] == named.name
    assert frame.loc["lateral_slip", "upper_bound"] > 0.0
