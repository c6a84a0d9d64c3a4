"""Causes outside the library are described by a term with their own size, and the test error shows it."""

from __future__ import annotations

import pytest
from tiny_vehicle import InMemory, Tiny, campaign_runs

from agvbench.diagnosis import Diagnosis, Verdict, diagnose

pytestmark = pytest.mark.slow

OUTSIDE = {
    "pull": (Tiny(pull_mps=0.02), "drift_to_point", {"mps": 0.02, "x_m": 0.3, "y_m": -0.2}, "x_m y_m"),
    "kick": (Tiny(kick_rad=0.05), "twist_at_start", {"same_rad": 0.05, "twist_rad": 0.0}, "time_in_run_s"),
    "seam": (Tiny(seam_rad=0.06), "turn_at_line", {"same_rad": 0.06, "turn_rad": 0.0}, "x_m y_m"),
    "downhill": (Tiny(downhill=0.06), "speed_by_course", {"cosine": 0.0324, "sine": 0.0505}, "course_rad"),
    "slide": (Tiny(creep_s=0.12), "slip_by_yaw_rate", {"side_s": -0.12, "turn_s": 0.0}, "curvature_per_m speed_mps"),
    "friction": (
        Tiny(friction_rad=0.03, friction_share=0.25),
        "steering_by_travel",
        {"half_width_rad": 0.03, "share": 0.25},
        "history",
    ),
    "rub": (Tiny(rub_loss=0.15), "speed_by_steering", {"front_left": 0.15, "rear_left": 0.0}, "curvature_per_m"),
    "yielding": (Tiny(yields_s_per_m=1.2), "steering_by_speed", {"front_s_per_m": 1.2}, "speed_mps curvature_per_m"),
    "sag": (
        Tiny(sag_per_rad=0.25),
        "speed_after_steering",
        {"loss_per_rad": 0.25, "time_constant_s": 0.6},
        "history time_in_run_s",
    ),
    "creep": (
        Tiny(step_creep=0.15, step_creep_s=1.2),
        "steering_creep",
        {"gain": 0.15, "time_constant_s": 1.2},
        "history time_in_run_s",
    ),
    "mixing": (
        Tiny(mixing_rad_s_per_m=0.2),
        "steering_by_velocity",
        {"front_rad_s_per_m": 0.2, "rear_rad_s_per_m": 0.2},
        "direction speed_mps",
    ),
    "saver": (Tiny(saver_slip_rad=0.05), "steering_slip", {"slip_rad": 0.05}, "history"),
    "cable": (Tiny(windup=-0.03), "steering_by_turned_heading", {"front": -0.03, "rear": 0.0}, "turned_rad"),
    "gyroscope": (
        Tiny(gyro_s_per_m=0.5),
        "steering_by_yaw_rate",
        {"front_s_per_m": 0.5, "rear_s_per_m": 0.0},
        "direction curvature_per_m speed_mps",
    ),
    "axle play": (
        Tiny(axle_play_rad=0.03),
        "steering_by_side_force",
        {"rear_rad": 0.03, "front_rad": 0.0},
        "curvature_per_m speed_mps",
    ),
    "supply": (
        Tiny(supply_loss_s_per_m=0.8),
        "speed_after_driving",
        {"loss_s_per_m": 0.8, "time_constant_s": 1.5},
        "history time_in_run_s",
    ),
    "brake": (
        Tiny(brake_s=0.2, brake_turn_per_m=1.5),
        "turn_while_coasting",
        {"curvature_per_m": 1.5},
        "speed_mps time_in_run_s",
    ),
    "run-out": (Tiny(run_out_rad=0.04), "wave_by_distance", {"turn_sine": 0.1325}, "distance_modulo_period_m"),
}


@pytest.mark.parametrize(("hidden", "term", "sizes", "covariates"), OUTSIDE.values(), ids=OUTSIDE)
def test_a_cause_outside_the_library_is_described_by_its_term(tiny_campaign, hidden, term, sizes, covariates):
    check_description(diagnose(tiny_campaign(hidden)), term, sizes, covariates)


def test_small_steps_show_the_dead_band_of_a_servo():
    found = diagnose(InMemory(campaign_runs(Tiny(dead_band=111.0), small_steps=True)))
    check_description(found, "steering_dead_band", {"share": 1.0}, "history curvature_per_m")
    assert 100.0 < found.provenance["empirical_term"]["parameters"]["width"] < 150.0


def test_reversals_show_the_pause_of_a_speed_controller():
    found = diagnose(InMemory(campaign_runs(Tiny(reversal_pause_s=0.3), reversals=True)))
    check_description(found, "pause_at_reversal", {"pause_s": 0.3}, "history direction")


def check_description(found: Diagnosis, term: str, sizes: dict[str, float], covariates: str) -> None:
    assert found.verdict is Verdict.UNKNOWN
    assert found.depends_on[0].covariate in covariates.split()
    empirical = found.provenance["empirical_term"]
    assert empirical["name"] == term
    assert {name: empirical["parameters"][name] for name in sizes} == pytest.approx(sizes, rel=0.15, abs=0.006)
    error = found.held_out.errors["position_rms_mm"]
    assert error["before"] > 2.0 * error["floor"]
    assert error["after"] < 1.3 * error["floor"]


def test_understeer_about_another_point_is_no_marker_offset(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(slip=1.0, slip_pivot_m=0.06)))
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("lateral_slip", "lateral_slip_pivot")
    for name, true in (("gradient", 1.0), ("pivot_m", 0.06)):
        own = effect.parameters[name]
        assert own.value == pytest.approx(true, abs=max(3.0 * own.stderr, 0.03 * true))


def test_distances_of_both_axles_may_be_wrong(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(wheelbase_m=0.310, marker_forward_m=0.015)))
    (effect,) = found.effects
    assert "marker_offset" in {effect.name, *effect.confounded_with}
    assert effect.name in {"marker_offset", "axle_coupling"}


@pytest.mark.parametrize("direction", [-3.1, -1.6, 0.0, 1.6, 3.1])
def test_a_tilt_is_found_in_every_direction(tiny_campaign, direction):
    found = diagnose(tiny_campaign(Tiny(tilt_mps=0.004, tilt_rad=direction)))
    (effect,) = found.effects
    assert effect.name == "floor_tilt"
    assert effect.parameters["drift_mps"].value == pytest.approx(0.004, rel=0.05)
    assert effect.parameters["direction_rad"].value == pytest.approx(direction, abs=0.03)


def test_two_causes_outside_the_library_have_two_terms(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(pull_mps=0.02, kick_rad=0.05)))
    terms = [found.provenance["empirical_term"], *found.provenance["further_terms"]]
    assert [term["name"] for term in terms] == ["drift_to_point", "twist_at_start"]
    assert terms[0]["parameters"]["mps"] == pytest.approx(0.02, rel=0.1)
    assert terms[1]["parameters"]["same_rad"] == pytest.approx(0.05, rel=0.1)
    assert {"x_m", "time_in_run_s"} <= {one.covariate for one in found.depends_on}
    assert "drift_to_point and twist_at_start describe it" in found.why
    error = found.held_out.errors["position_rms_mm"]
    assert error["after"] < 1.3 * error["floor"]
