"""A cause keeps its name where its law is another than the library's, and a vehicle keeps the law it is known by."""

from __future__ import annotations

import pytest
from tiny_vehicle import Tiny

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
