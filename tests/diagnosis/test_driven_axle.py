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
@pytest.mark.slow
def test_a_declared_driven_axle_leaves_nothing_to_find(tiny_campaign, driven, share):
    found = diagnose(declared(tiny_campaign(Tiny(front_drive_share=share)), driven))
    assert found.verdict is Verdict.ADEQUATE
    assert found.effects == ()
    assert found.model.geometry.driven == driven


@pytest.mark.slow
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
@pytest.mark.parametrize(("share", "axle"), [(0.0, "rear"), (1.0, "front")])
def test_an_undeclared_driven_axle_is_found(tiny_campaign, share, axle):
    found = diagnose(tiny_campaign(Tiny(front_drive_share=share)))
    assert found.verdict is Verdict.ADEQUATE
    assert f'declare driven = "{axle}"' in found.why
    assert found.model.geometry.driven == axle
    assert found.to_json()["provenance"]["driven_axle"] == axle
    position = found.held_out.errors["position_rms_mm"]
    assert position["before"] > 2.0 * position["after"]


@pytest.mark.slow
def test_an_undeclared_driven_axle_is_found_beside_a_vehicle_file(tiny_campaign):
    calibrated = calibrate(tiny_campaign(Tiny())).model
    found = diagnose(tiny_campaign(Tiny(front_drive_share=0.0)), vehicle=calibrated)
    assert found.verdict is Verdict.ADEQUATE
    assert found.model.geometry.driven == "rear"


@pytest.mark.slow
def test_a_cause_beside_an_undeclared_driven_axle_is_named_with_its_size(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(front_drive_share=0.0, steering_lag_s=0.15)))
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    assert found.effects[0].parameters["time_constant_s"].value == pytest.approx(0.15, rel=0.03)
    assert found.model.geometry.driven == "rear"


@pytest.mark.slow
@pytest.mark.parametrize("tiny", [Tiny(cornering_loss=0.05), Tiny(overrun=0.6)])
def test_a_loss_of_speed_in_turns_is_no_driven_axle(tiny_campaign, tiny):
    found = diagnose(tiny_campaign(tiny))
    assert found.model.geometry.driven == "both"
    assert "driven_axle" not in found.to_json()["provenance"]
    assert {effect.name for effect in found.effects} & {"cornering_speed_loss", "axle_overrun"}
