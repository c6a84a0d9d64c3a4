"""A vehicle that one axle drives: the speed in turns is no effect once the campaign declares it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tiny_vehicle import HEADER, InMemory, Tiny

from agvbench.calibration import calibrate
from agvbench.diagnosis import Verdict, diagnose


def declared(campaign: InMemory, driven: str) -> InMemory:
    return InMemory(campaign.runs, replace(HEADER, schema=2, driven=driven))


@pytest.mark.parametrize(("driven", "share"), [("rear", 0.0), ("front", 1.0)])
def test_a_declared_driven_axle_leaves_nothing_to_find(tiny_campaign, driven, share):
    found = diagnose(declared(tiny_campaign(Tiny(front_drive_share=share)), driven))
    assert found.verdict is Verdict.ADEQUATE
    assert found.effects == ()
    assert found.model.geometry.driven == driven


def test_a_cause_beside_a_driven_rear_axle_is_named_with_its_size(tiny_campaign):
    found = diagnose(declared(tiny_campaign(Tiny(front_drive_share=0.0, cornering_loss=0.05)), "rear"))
    assert [effect.name for effect in found.effects] == ["cornering_speed_loss"]
    estimate = found.effects[0].parameters["loss"]
    assert abs(estimate.value - 0.05) < 4.0 * estimate.stderr + 1e-3


def test_effects_of_two_driven_axles_are_no_candidates(tiny_campaign):
    campaign = declared(tiny_campaign(Tiny(front_drive_share=0.0)), "rear")
    considered = str(diagnose(campaign).to_json())
    assert "axle_speed_mismatch" not in considered
    assert "axle_overrun" not in considered


def test_calibration_keeps_the_declared_axle(tiny_campaign):
    campaign = declared(tiny_campaign(Tiny(front_drive_share=0.0)), "rear")
    model = calibrate(campaign).model
    assert model.geometry.driven == "rear"
    assert float(model.speed(900.0)) == pytest.approx(0.32, abs=0.004)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_an_undeclared_driven_axle_is_no_gain_of_speed_in_turns(tiny_campaign, share):
    found = diagnose(tiny_campaign(Tiny(front_drive_share=share)))
    assert found.verdict is Verdict.UNKNOWN
    assert [effect.name for effect in found.effects] == []
