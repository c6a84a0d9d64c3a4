"""Verdicts on free driving of a vehicle of known truth, in sessions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from free_drives import FREE_HEADER, calm, free_runs, stop_and_go
from tiny_vehicle import NEUTRAL_COMMAND, Tiny

from agvbench.diagnosis import Diagnosis, Verdict, diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.findings.corrected_vehicle import _table, corrected_vehicle
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.diagnosis.model.predictor import MAX_ANGLE_RAD
from agvbench.effects.variants import effect_variants
from agvbench.errors import CampaignError
from agvbench.model import VehicleModel
from agvbench.types import Run


class FreeCampaign:
    header = FREE_HEADER

    def __init__(self, runs: list[Run]) -> None:
        self.runs = runs

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)


@pytest.fixture(scope="module")
def lagging() -> Diagnosis:
    return diagnose(FreeCampaign(free_runs(Tiny(steering_lag_s=0.25), runs=2, seconds=24.0)))


def test_a_steering_lag_is_named_with_its_size(lagging):
    assert [effect.name for effect in lagging.effects] == ["steering_lag"]
    assert lagging.effects[0].parameters["time_constant_s"].value == pytest.approx(0.25, abs=0.02)
    assert lagging.verdict is Verdict.NAMED
    errors = lagging.held_out.errors
    for name in ("position_rms_mm", "heading_rms_deg"):
        assert errors[name]["after"] < 0.2 * errors[name]["before"]


def test_a_lag_of_slow_steering_is_no_delay():
    """Initial angles by the noisy yaw rate predict better than the commands without the lag, and worse with it."""
    runs = free_runs(Tiny(steering_lag_s=0.15, noise_rad=3e-3), sessions=3, runs=2, seconds=24.0, by=calm)
    (effect,) = diagnose(FreeCampaign(runs)).effects
    assert effect.name == "steering_lag"
    assert effect.parameters["time_constant_s"].value == pytest.approx(0.15, abs=0.01)


def test_a_drive_of_limited_force_is_a_speed_lag_with_its_acceleration_and_coasting():
    """One lag for accelerating, braking and coasting leaves a structure that other effects would compensate for."""
    truth = Tiny(ramp_forward_mps2=0.25, ramp_backward_mps2=0.25, coast_s=0.3, is_ramp_of_force=True)
    found = diagnose(FreeCampaign(free_runs(truth, runs=2, seconds=24.0, by=stop_and_go)))
    (effect,) = found.effects
    assert (effect.name, effect.evidence["form"]) == ("speed_lag", "speed_lag_coasting")
    assert effect.parameters["acceleration_mps2"].value == pytest.approx(0.25, rel=0.1)
    assert effect.parameters["coast_s"].value == pytest.approx(0.3, rel=0.1)
    assert found.verdict is Verdict.NAMED


def test_residuals_along_the_way_shrink_to_what_noise_leaves(lagging):
    residuals = lagging.residuals
    assert set(residuals["held_out"]) == {False, True}
    held = residuals[residuals["held_out"]]
    assert held["after_turning"].abs().median() < 0.3 * held["before_turning"].abs().median()


def test_each_recording_is_told_with_every_predictor(lagging):
    windows = json.loads(lagging.to_text())["provenance"]["windows"]
    assert (windows["horizon_s"], windows["stride_s"]) == (2.0, 1.0)
    assert len(windows["recordings"]) == 8
    held = [row for row in windows["recordings"] if row["held_out"]]
    assert held
    for row in held:
        ahead = row["ahead_2_s"]
        after = ahead["after_mm"]["rms"]
        assert after < 0.3 * min(ahead[f"{name}_mm"]["rms"] for name in ("static", "speed_held", "naive"))
    sessions = {row["session"] for row in held}
    assert not sessions & {row["session"] for row in windows["recordings"] if not row["held_out"]}


def test_every_effect_is_listed_with_what_it_does_to_sessions_held_out(lagging):
    effects = lagging.provenance["windows"]["effects"]
    assert [name for name, entry in effects.items() if entry["kept"]] == ["steering_lag"]
    own = effects["steering_lag"]["held_out_position_mm"]
    assert own["with"] < own["without"]
    assert {"lateral_slip", "speed_lag", "mocap_latency"} < set(effects)


def test_parameters_that_these_recordings_do_not_identify_are_told(lagging):
    # The joystick drives forwards only.
    assert "reverse_steering_gain.gain" in lagging.provenance["not_identifiable"]
    assert "steering_lag.time_constant_s" not in lagging.provenance["not_identifiable"]


def test_what_would_distinguish_causes_that_no_run_does_is_told():
    found = diagnose(FreeCampaign(free_runs(Tiny(delay_s=0.08), runs=1, seconds=24.0)))
    assert found.verdict is Verdict.AMBIGUOUS
    (item,) = found.to_json()["provenance"]["inseparable"]
    assert set(item["between"]) == {"actuation_delay", "mocap_latency"}
    assert "a time that vehicle and cameras share" in item["needs"]


@pytest.mark.slow
def test_a_corrected_vehicle_with_another_law_is_diagnosed_again(lagging, tmp_path):
    law = effect_variants()["steering_lag_inertia"](time_constant_s=0.25, inertia_s=0.01)
    replace(lagging.model, effects=(law,)).save(tmp_path / "corrected.toml")
    again = diagnose(
        FreeCampaign(free_runs(Tiny(steering_lag_s=0.25), runs=1, seconds=20.0)),
        vehicle=VehicleModel.load(tmp_path / "corrected.toml"),
    )
    assert not again.effects
    # Both as they were fitted: the second is without the estimates from each recording.
    for row in (row for row in again.provenance["windows"]["recordings"] if row["held_out"]):
        believed, refitted = (row["ahead_2_s"][f"{name}_mm"]["rms"] for name in ("believed", "population"))
        assert believed == pytest.approx(refitted, rel=0.2)
    assert [effect.name for effect in again.model.effects] == ["steering_lag_inertia"]


def test_nothing_is_named_where_nothing_is_hidden():
    found = diagnose(FreeCampaign(free_runs(Tiny(), runs=2, seconds=24.0)))
    assert found.verdict is Verdict.ADEQUATE
    assert not found.effects
    errors = found.held_out.errors["position_rms_mm"]
    assert errors["after"] < 1.3 * errors["before"] < 10.0  # mm, 2 s ahead


def test_too_little_driving_is_refused_in_one_line():
    with pytest.raises(CampaignError, match="too little free driving"):
        diagnose(FreeCampaign(free_runs(Tiny(), sessions=1, runs=1, seconds=10.0)))


def mirrored(run: Run) -> Run:
    """Return a run on a floor with a reversed y axis."""
    return replace(run, frames=replace(run.frames, y_m=-run.frames.y_m))


def test_few_long_recordings_on_a_mirrored_floor_are_refused():
    runs = [mirrored(run) for run in free_runs(Tiny(), sessions=2, runs=1, seconds=40.0)]
    with pytest.raises(CampaignError, match="heading_rad and the floor are mirrored"):
        diagnose(FreeCampaign(runs))


def test_an_angle_that_no_axle_has_is_the_limit_in_the_corrected_vehicle():
    readings = read_windows(free_runs(Tiny(), sessions=2, runs=1), Horizon(2.0, 1.0), NEUTRAL_COMMAND)
    fitted = static_maps(readings, readings.runs, FREE_HEADER.geometry, NEUTRAL_COMMAND)
    maps = fitted.predictor.maps
    wild = fitted.parameters.copy()
    wild[maps.slices()["front"]] *= 100.0
    vehicle = corrected_vehicle(FREE_HEADER, FREE_HEADER.geometry, replace(fitted, parameters=wild), maps, 0)
    assert max(map(abs, vehicle.front.output_range)) == pytest.approx(MAX_ANGLE_RAD)


@pytest.mark.parametrize("seed", range(20))
def test_an_axle_that_does_not_respond_has_a_fixed_angle_or_an_ascending_or_descending_one(seed):
    """Its angles are noise, and known very differently from level to level."""
    rng = np.random.default_rng(seed)
    commands, angles = np.linspace(1000.0, 2000.0, 7), rng.normal(0.0, 1e-3, 7)
    made = _table(commands, angles, 10.0 ** rng.uniform(0.0, 6.0, 7))
    assert np.abs(made(commands)).max() <= np.abs(angles).max() + 1e-6
