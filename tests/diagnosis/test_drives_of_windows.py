"""Equations of the drive in free driving, in place of a selected effect and beside one."""

from __future__ import annotations

import pytest
from free_drives import FREE_HEADER, free_runs, stop_and_go
from tiny_vehicle import HEADER, NEUTRAL_COMMAND, Tiny

from agvbench.diagnosis import diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.design.alternatives import equation_of, swapped
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.diagnosis.free_driving.selection import DRIVES, WindowSelector, select_drive
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.selection.candidates import candidates
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import candidates_for
from agvbench.effects.variants import cause_of, effect_variants
from agvbench.vehicle.geometry import Geometry

TRUTH = Tiny(ramp_forward_mps2=0.25, ramp_backward_mps2=0.25, coast_s=0.3, is_ramp_of_force=True)


def selector_of(truth: Tiny) -> WindowSelector:
    runs = free_runs(truth, sessions=3, runs=1, by=stop_and_go)
    geometry = Geometry(HEADER.front_axle_m, HEADER.rear_axle_m)
    readings = read_windows(runs, Horizon(2.0, 1.0), NEUTRAL_COMMAND)
    static = static_maps(readings, runs, geometry, NEUTRAL_COMMAND)
    tried, kinds = candidates_for(None, geometry)
    batch = Batch(readings, static.predictor.maps, geometry, kinds=kinds)
    return WindowSelector(batch, tried, static.parameters, 0, lambda text: None)


@pytest.fixture
def selector() -> WindowSelector:
    return selector_of(TRUTH)


@pytest.mark.parametrize("names", [(), ("speed_lag",), ("cornering_speed_loss",)])
def test_the_equation_of_the_drive_is_found_beside_any_selection(selector, names):
    base = selector.base()
    chosen = base
    for name in names:
        chosen = selector.with_effect(chosen, name)
    selected, extended = select_drive(Selection(base, chosen, {}, dict.fromkeys(names, 0.0), {}, 0), selector)
    assert selected.chosen.names == ("speed_lag_coasting",)
    assert "speed_lag_coasting" in extended.candidates
    assert not any(kind.name in DRIVES for kind in selector.batch.kinds)
    assert {kind.name for kind in extended.batch.kinds} > DRIVES


def test_an_equation_that_predicts_no_better_is_not_taken():
    selector = selector_of(Tiny())
    nothing = Selection(selector.base(), selector.base(), {}, {}, {}, 0)
    found, same = select_drive(nothing, selector)
    assert found is nothing
    assert same is selector


def test_the_equations_are_of_the_speed_and_have_few_parameters():
    assert {"speed_lag_ramp", "speed_lag_coasting", "speed_lag_motor", "wheel_lag_inertia"} < DRIVES
    assert "speed_lag_spring_back" not in DRIVES
    assert all(len(effect_variants()[name].parameters()) <= 3 for name in DRIVES)


def test_what_is_not_identified_is_said_for_a_model_with_another_equation_of_the_drive():
    runs = free_runs(TRUTH, sessions=3, runs=1, by=stop_and_go)
    found = diagnose(type("Drives", (), {"header": FREE_HEADER, "__iter__": lambda _: iter(runs)})())
    assert [(effect.name, effect.evidence["form"]) for effect in found.effects] == [("speed_lag", "speed_lag_coasting")]
    assert set(found.provenance["not_identifiable"]) == {"reverse_steering_gain.gain"}


def test_an_alternative_has_another_equation_where_that_of_the_library_predicts_worse(selector):
    base = selector.base()
    nothing = Selection(base, base, {}, {}, {}, 0)
    chosen = select_drive(nothing, selector)[0].chosen.fit
    assert equation_of(chosen, "speed_lag") == "speed_lag_coasting"
    other = swapped(chosen, "speed_lag", "speed_lag", candidates(chosen.predictor.batch.geometry))
    assert other.predictor.effects == ("speed_lag_coasting",)
    assert other.total_loss == pytest.approx(chosen.total_loss, abs=1.0)


def test_the_gain_of_every_effect_that_was_not_selected_is_listed_whether_it_was_fitted_or_not(selector):
    selection = selector.select()
    causes = {cause_of(name) for name in selection.chosen.names}
    assert {*selection.rejected} | causes == {*selector.candidates}
    unlikely = [name for name in selection.rejected if selector.known((*selection.chosen.names, name)) is None]
    assert unlikely
    assert all(selection.rejected[name] == 0.0 for name in unlikely)
