"""An answer beside the truth: what a trial keeps of a diagnosis and of a plant."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agvbench.challenge import challenge
from agvbench.challenge.campaigns import TrialKind
from agvbench.challenge.challenge import hold_trial, unsealed
from agvbench.diagnosis import Dependence, Diagnosis, Estimate, HeldOut, NamedEffect, Verdict
from agvbench.simulator.hidden import make_hidden_plant


def truth(spec):
    return make_hidden_plant(spec, 4, floors=0.0).sealed_truth()


def test_trial_holds_answer_and_truth():
    lag = NamedEffect("steering_lag", {"time_constant_s": Estimate(0.2, 0.01, "s")}, (), {})
    held = HeldOut(9, {"position_rms_mm": {"before": 30.0, "after": 4.0, "floor": 3.0}}, ("5",))
    patch = Dependence("x_m", "speed", 1e-6, 0.3)
    found = Diagnosis(Verdict.UNKNOWN, "", (lag,), significant=True, depends_on=(patch,), held_out=held)
    sealed = truth("steering_lag_and_slow_patch")
    trial = unsealed("steering_lag_and_slow_patch", 4, sealed, found, 1.5)
    assert trial.is_right
    assert trial.outside == 1
    assert trial.depends_on == ("x_m",)
    assert trial.covariates == ("x_m", "y_m")
    assert trial.true_parameters == {"steering_lag": sealed.effects[0].parameters}
    assert trial.estimates == {"steering_lag": {"time_constant_s": (0.2, 0.01)}}
    assert trial.squares_mm2 == {"before": 900.0, "after": 16.0, "floor": 9.0}
    assert trial.worse_on == ("5",)
    assert trial.answer == "UNKNOWN steering_lag"


def test_parameters_of_another_form_are_not_compared():
    trial = unsealed("lateral_slip_linear", 4, truth("lateral_slip_linear"), Diagnosis(Verdict.ADEQUATE, ""), 1.0)
    assert trial.true_parameters == {}
    assert trial.library_names == ("lateral_slip",)
    assert not trial.is_right


@pytest.mark.slow
def test_a_blind_trial_from_drive_to_score():
    trial = hold_trial("speed_lag", 11, TrialKind(2))
    assert trial.verdict != "ERROR"
    assert "speed_lag" in trial.named
    assert trial.squares_mm2["after"] < 0.2 * trial.squares_mm2["before"]


@pytest.mark.slow
def test_a_blind_trial_of_a_differential_vehicle() -> None:
    trial = hold_trial("wheel_diameter_mismatch", 301, TrialKind(2, "differential"))
    assert trial.named == ("wheel_diameter_mismatch",)
    assert trial.is_right
    true = trial.true_parameters["wheel_diameter_mismatch"]["curvature_per_m"]
    value, stderr = trial.estimates["wheel_diameter_mismatch"]["curvature_per_m"]
    assert abs(value - true) < 4.0 * stderr + 1e-3


@pytest.mark.slow
def test_a_pair_left_open_between_a_delay_and_its_true_rival_is_right(monkeypatch):
    """Rivals are looked for per effect, as if it were hidden alone; driving plants for that takes minutes."""
    alone = {"actuation_delay": {"mocap_latency": 0.1}, "battery_droop": {}}
    monkeypatch.setattr(challenge, "indistinguishable_effects", lambda _, sealed: alone[sealed.effects[0].name])
    spec = "actuation_delay_and_battery_droop"
    found = Diagnosis(
        Verdict.AMBIGUOUS,
        "",
        (NamedEffect("mocap_latency", {}, ("actuation_delay",), {}), NamedEffect("battery_droop", {}, (), {})),
    )
    trial = unsealed(spec, 4, truth(spec), found, 1.0)
    assert trial.rivals == ("mocap_latency",)
    assert trial.is_right
    assert not unsealed(spec, 4, truth(spec), replace(found, effects=found.effects[:1]), 1.0).is_right
