"""Actuators against a latency of the camera: whichever explains the runs, and never a filter for slow actuators."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tiny_vehicle import HEADER, Tiny, campaign_runs

from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.diagnosis.selection.actuators import CAMERA, prefer_actuators
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import with_extended_library
from agvbench.effects.variants import cause_of
from agvbench.vehicle.geometry import Geometry

SLOW = Tiny(delay_s=0.06, steering_lag_s=0.1, accelerate_s=0.15, brake_s=0.25)


def selected(tiny: Tiny, *names: str) -> tuple[Selection, Selector]:
    """Return a selection of the effects `names`, fitted to the runs of a vehicle, with its selector."""
    geometry = Geometry(HEADER.front_axle_m, HEADER.rear_axle_m)
    method = RunsFromRest(DiagnosisContext(HEADER, geometry, None, 0), lambda line: None)
    runs = list(campaign_runs(tiny))
    selector = method.selector(read_runs(runs, HEADER.neutral))
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
