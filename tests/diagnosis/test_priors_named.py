"""What priors decide: which of two indistinguishable causes is named, and what is said of a false prior."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from tiny_vehicle import FRONT_M, HEADER, REAR_M, InMemory, Tiny

from agvbench.diagnosis import Verdict, diagnose
from agvbench.effects import WheelbaseError
from agvbench.model import Prior, nominal_model
from agvbench.model.priors import priors_to_toml
from agvbench.vehicle.channels import Channels

pytestmark = pytest.mark.slow


def latency(value, standard_deviation=0.001):
    return Prior("mocap_latency", "latency_s", value, standard_deviation, "data sheet")


NO_DELAY = Prior("actuation_delay", "delay_s", 0.0, 0.001, "oscilloscope")


def stated(*priors, effects=()):
    """Return the nominal vehicle with priors."""
    return replace(nominal_model("tiny", HEADER.geometry, Channels.alike("us")), priors=priors, effects=effects)


def seen_late(campaign, latency_s):
    """Return the campaign as cameras record it whose stamps are late: the pose stamped t was true at t − latency."""
    return InMemory([replace(run, frames=replace(run.frames, t_s=run.frames.t_s + latency_s)) for run in campaign.runs])


def found_in(found):
    """Return the effects that explain the motion; end stops are read off the maps."""
    return {effect.name: effect for effect in found.effects if effect.name != "steering_saturation"}


def test_a_camera_whose_stamps_are_exact_leaves_a_delay(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(delay_s=0.1)), vehicle=stated(latency(0.0)))
    assert found.verdict is Verdict.NAMED
    (delay,) = found_in(found).values()
    assert (delay.name, delay.confounded_with) == ("actuation_delay", ())
    assert delay.parameters["delay_s"].value == pytest.approx(0.1, abs=0.001)
    assert delay.evidence["excluded_by_priors"] == ["mocap_latency"]
    (prior,) = json.loads(found.to_text())["provenance"]["priors"]
    assert (prior["value"], prior["standard_deviation"], prior["source"]) == (0.0, 0.001, "data sheet")
    assert prior["used"]
    assert not prior["contradicted"]
    assert priors_to_toml(found.model.priors) == priors_to_toml((latency(0.0),))


def test_commands_that_take_effect_at_once_leave_a_latency(tiny_campaign):
    found = diagnose(seen_late(tiny_campaign(Tiny()), 0.038), vehicle=stated(NO_DELAY))
    assert found.verdict is Verdict.NAMED
    (late,) = found_in(found).values()
    assert (late.name, late.confounded_with) == ("mocap_latency", ())
    assert late.parameters["latency_s"].value == pytest.approx(0.038, abs=0.001)
    assert "actuation_delay" in late.evidence["excluded_by_priors"]


def test_a_documented_latency_divides_the_time_between_camera_and_vehicle(tiny_campaign):
    found = diagnose(seen_late(tiny_campaign(Tiny(delay_s=0.025)), 0.008), vehicle=stated(latency(0.008)))
    assert found.verdict is Verdict.NAMED
    effects = found_in(found)
    assert effects["actuation_delay"].evidence["excluded_by_priors"] == ["mocap_latency"]
    assert "excluded_by_priors" not in effects["mocap_latency"].evidence
    assert set(effects) == {"actuation_delay", "mocap_latency"}
    for name, key, value in (("actuation_delay", "delay_s", 0.025), ("mocap_latency", "latency_s", 0.008)):
        estimate = effects[name].parameters[key]
        assert estimate.value == pytest.approx(value, abs=0.001)
        assert estimate.stderr == pytest.approx(0.001, rel=0.2)  # all that is known of the division
    own = effects["mocap_latency"].evidence["prior"]["latency_s"]
    assert abs(own["deviation"]) < 1.0
    assert own["gain"] == pytest.approx(64.0, rel=0.1)


def test_a_false_prior_is_contradicted_and_does_not_win_silently(tiny_campaign):
    lag = Prior("steering_lag", "time_constant_s", 0.05, 0.002, "data sheet")
    found = diagnose(tiny_campaign(Tiny(steering_lag_s=0.15)), vehicle=stated(lag))
    assert found.verdict is Verdict.UNKNOWN
    assert found.significant
    says = "prior of steering_lag.time_constant_s (data sheet) says 0.05 ± 0.002 s, the campaign 0.1"
    assert found.why.startswith(f"the campaign contradicts a prior: {says}")
    (prior,) = json.loads(found.to_text())["provenance"]["priors"]
    assert prior["contradicted"]
    assert prior["campaign"]["value"] == pytest.approx(0.15, abs=0.003)


def test_a_wheelbase_within_the_error_of_its_measurement_is_no_scale_of_the_camera(tiny_campaign):
    ruler = Prior("wheelbase_error", "longer", 0.0, 2.0**0.5 * 0.001 / (FRONT_M + REAR_M), "ruler")
    vehicle = stated(ruler, effects=(WheelbaseError(0.0),))
    tiny = Tiny(wheelbase_m=FRONT_M + REAR_M + 0.001, steering_lag_s=0.1)
    found = diagnose(tiny_campaign(tiny), vehicle=vehicle)
    assert set(found_in(found)) == {"steering_lag"}
    assert found.verdict is Verdict.NAMED
    assert found.model.effect("wheelbase_error").longer == pytest.approx(0.001 / (FRONT_M + REAR_M), abs=0.002)
