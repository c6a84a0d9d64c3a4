"""Differential vehicles: what a plant of a few lines hides is named, and where nothing is hidden nothing is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from differential_vehicle import COARSE, Campaign, Differential

from agvbench.diagnosis import Diagnosis, Verdict, diagnose
from agvbench.effects import effect_kinds
from agvbench.model import VehicleModel

CURVATURE = 2.0 * 0.03 / (2.03 * 0.4)  # the right wheel is 3 % larger, on a track of 0.4 m


def found(diagnosis: Diagnosis) -> dict[str, float]:
    """Return every parameter that was found, by effect and name."""
    return {f"{e.name}.{name}": p.value for e in diagnosis.effects for name, p in e.parameters.items()}


@pytest.mark.parametrize(
    ("truth", "expected", "tolerance"),
    [
        ({"yaw_lag_s": 0.3}, {"steering_lag.time_constant_s": 0.3}, 0.01),
        ({"yaw_lag_s": 0.3, "speed_lag_s": 0.3}, {"wheel_lag.time_constant_s": 0.3}, 0.01),
        ({"yaw_acceleration": 2.0}, {"yaw_acceleration_limit.acceleration_radps2": 2.0}, 0.1),
        ({"speed_lag_s": 0.3}, {"speed_lag.accelerate_s": 0.3, "speed_lag.brake_s": 0.3}, 0.01),
        ({"right_wheel": 1.03}, {"wheel_diameter_mismatch.curvature_per_m": CURVATURE}, 0.003),
        ({"marker_ahead_m": 0.13}, {"marker_offset.forward_m": 0.03}, 0.002),
        ({"slip_by_speed": 1.0}, {"lateral_slip.gradient": 1.0}, 0.03),
    ],
)
@pytest.mark.slow
def test_one_cause_is_named_with_its_size(truth, expected, tolerance):
    diagnosis = diagnose(Campaign(Differential(**truth)))
    assert diagnosis.verdict is Verdict.NAMED
    values = found(diagnosis)
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, abs=tolerance)
    # A larger wheel shifts the centre of rotation, too, which is the same as markers off the centre line.
    assert {name.partition(".")[0] for name in values} <= {*(n.partition(".")[0] for n in expected), "marker_offset"}
    errors = diagnosis.held_out.errors["position_rms_mm"]
    assert errors["after"] < 0.5 * errors["before"]


def test_a_delay_is_left_open_between_command_and_camera():
    diagnosis = diagnose(Campaign(Differential(delay_s=0.12)))
    assert diagnosis.verdict is Verdict.AMBIGUOUS
    assert diagnosis.effects[0].name == "actuation_delay"  # of equals, the camera is named last
    assert diagnosis.effects[0].confounded_with == ("mocap_latency",)
    assert next(iter(found(diagnosis).values())) == pytest.approx(0.12, abs=0.005)


def test_a_late_drive_and_a_slow_rotation_are_told_apart():
    # One delay of all commands resembles both, and leaves neither the other delay nor the lag a gain of its own.
    diagnosis = diagnose(Campaign(Differential(further_speed_delay_s=0.5, yaw_lag_s=1.2), sessions=3, seconds=40.0))
    values = found(diagnosis)
    assert values["actuation_delay.drive_s"] == pytest.approx(0.5, abs=0.02)
    assert values["actuation_delay.steering_s"] == pytest.approx(0.0, abs=0.03)
    assert values["steering_lag.time_constant_s"] == pytest.approx(1.2, rel=0.05)
    errors = diagnosis.held_out.errors["position_rms_mm"]
    assert errors["after"] < 0.1 * errors["before"]


@pytest.mark.parametrize("noisy", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_tyres_that_resist_turning_are_named_with_friction_and_integral_time(noisy):
    hidden = {"scrub_radps": 0.3, "integral_time_s": 2.5}
    truth = dataclasses.replace(COARSE, **hidden) if noisy else Differential(**hidden)
    diagnosis = diagnose(Campaign(truth))
    values = found(diagnosis)
    assert {name.partition(".")[0] for name in values} == {"turning_resistance"}
    share = 0.2 if noisy else 0.05
    assert values["turning_resistance.friction_radps"] == pytest.approx(0.3, rel=share)
    assert values["turning_resistance.integral_time_s"] == pytest.approx(2.5, rel=share)
    errors = diagnosis.held_out.errors["heading_rms_deg"]
    assert errors["after"] < 0.5 * errors["before"]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.slow
def test_nothing_is_found_where_nothing_is_hidden(seed):
    assert diagnose(Campaign(Differential(), seed=seed)).verdict is Verdict.ADEQUATE


@pytest.mark.slow
def test_five_causes_at_once_are_found_together(tmp_path):
    truth = Differential(yaw_lag_s=0.3, speed_lag_s=0.25, delay_s=0.1, right_wheel=1.02, marker_ahead_m=0.12)
    diagnosis = diagnose(Campaign(truth))
    values = found(diagnosis)
    # What both lags have in common may be called a lag of the wheels.
    common = values.get("wheel_lag.time_constant_s", 0.0)
    assert common + values.get("steering_lag.time_constant_s", 0.0) == pytest.approx(0.3, abs=0.01)
    assert common + values.get("speed_lag.brake_s", 0.0) == pytest.approx(0.25, abs=0.01)
    assert values["marker_offset.forward_m"] == pytest.approx(0.02, abs=0.003)
    assert diagnosis.held_out.errors["position_rms_mm"]["after"] < 6.0
    assert diagnosis.held_out.errors["position_rms_mm"]["before"] > 60.0
    corrected = diagnosis.model
    corrected.save(tmp_path / "vehicle.toml")
    again = VehicleModel.load(tmp_path / "vehicle.toml")
    assert again.calibration_hash == corrected.calibration_hash
    assert again.geometry.is_differential
    np.testing.assert_allclose(again.front(np.array([0.6, -0.6])), [0.7 * 0.6, -0.7 * 0.6], atol=0.02)


def test_no_effect_of_steered_axles_is_tried():
    diagnosis = diagnose(Campaign(Differential(), sessions=3))
    tried = diagnosis.provenance["windows"]["effects"]
    assert tried
    assert not any(effect_kinds()[name].needs_steered_axles for name in tried if name in effect_kinds())
