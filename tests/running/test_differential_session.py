"""A session with a differential vehicle: calibrated from straights and turns on the spot, driven, and diagnosed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from agvbench.calibration import calibrate
from agvbench.campaign import Campaign, CampaignHeader
from agvbench.diagnosis import Diagnosis, Verdict, diagnose
from agvbench.errors import FitError
from agvbench.model import VehicleModel
from agvbench.model.examples import example_path
from agvbench.running.session.driver import NotDrivenError
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession
from agvbench.simulator.differential import DifferentialVehicle
from agvbench.statistics.run_errors import run_error
from agvbench.types import Run

TRUTH = DifferentialVehicle()
SHARES = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)
OPTIONS = {
    "vehicle": str(example_path("differential")), "plant": "agvbench.simulator:differential_plant", "seed": 5,
}  # fmt: skip


def calibrated(opened: BenchSession) -> VehicleModel:
    """Drive straights and turns on the spot, three times each, and return what the session calibrates from them."""
    for repeat in range(1, 4):
        for share in SHARES:
            opened.driver(f"drive-{share}-{repeat}", experiment="drive", repeat=repeat).hold(for_s=3.0, drive=share)
            opened.driver(f"turn-{share}-{repeat}", experiment="yaw_rate", repeat=repeat).hold(for_s=4.0, front=share)
    return opened.model("calibrated")


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign with the eight trajectories, calibrated, and others that start, stop and turn while driving."""
    path = tmp_path_factory.mktemp("differential") / "campaign"
    with open_session(OPTIONS, out=str(path), resume=False, dry_run=False) as opened:
        calibrated(opened)
        for repeat in range(1, 4):
            for name in ("1", "2", "5", "6", "7", "8", "slalom", "s_curve"):
                driver = opened.driver(f"{name}-{repeat}", experiment="trajectory", repeat=repeat)
                driver.trajectory(name, condition="calibrated")
    return path


def test_the_maps_are_those_of_the_wheels(driven: Path) -> None:
    model = VehicleModel.load(driven / "vehicle.toml")
    radius = 0.5 * (TRUTH.left_radius + TRUTH.right_radius)
    # At a small share of full speed the difference of the wheels counts little.
    assert float(model.speed(0.3)) == pytest.approx(0.3 * radius, rel=0.003)
    yaw_rate = TRUTH.assumed_track_m / TRUTH.true_track_m * radius
    np.testing.assert_allclose(model.front(np.array([-1.0, 0.0, 1.0])), [-yaw_rate, 0.0, yaw_rate], atol=0.004)
    assert model.provenance["method"] == "straights and turns on the spot"
    assert model.geometry.is_differential


def test_measurements_have_a_row_for_each_run_and_channel(driven: Path) -> None:
    table = calibrate(driven).measurements
    assert table["axle"].value_counts().to_dict() == {"drive": 24, "front": 24}
    turns = table[table["axle"] == "front"]
    assert float((turns["value"] / turns["command"]).std()) < 0.01
    assert (table["stderr"] > 0.0).all()


def test_a_rejected_run_is_no_sample(driven: Path) -> None:
    campaign = Campaign.open(driven)
    rejected = next(run.run_id for run in campaign if run.experiment == "yaw_rate")
    runs = [replace(run, status="rejected: moved") if run.run_id == rejected else run for run in campaign]
    found = calibrate(InMemory(campaign.header, runs))
    assert rejected not in set(found.measurements["run_id"])
    assert f"run {rejected} left out: rejected: moved" in found.warnings


@dataclass(frozen=True)
class InMemory:
    header: CampaignHeader
    runs: list[Run]

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)


def test_what_calibration_cannot_know_remains(driven: Path) -> None:
    errors = {run.trajectory: run_error(run) for run in Campaign.open(driven) if run.trajectory in ("1", "5", "6")}
    # The right wheel is 1 % larger: straights bend to the left, and left turns are too far where right ones are short.
    assert 1.0 < errors["1"].delta_heading_deg < 5.0
    assert errors["5"].position_mm > 20.0


@pytest.mark.slow
def test_the_diagnosis_names_the_wheels_and_the_lags(driven: Path) -> None:
    found: Diagnosis = diagnose(Campaign.open(driven))
    values = {e.name: {name: p.value for name, p in e.parameters.items()} for e in found.effects}
    assert set(values) == {"wheel_diameter_mismatch", "marker_offset", "wheel_lag", "actuation_delay"}
    apart, mean = TRUTH.right_radius - TRUTH.left_radius, 0.5 * (TRUTH.right_radius + TRUTH.left_radius)
    bend = apart / mean / TRUTH.true_track_m
    assert values["wheel_diameter_mismatch"]["curvature_per_m"] == pytest.approx(bend, abs=0.003)
    assert values["marker_offset"]["forward_m"] == pytest.approx(TRUTH.marker_forward_m - 0.05, abs=0.001)
    # The wheels have a lag of 2 ζ / ω and an inertia of 1 / ω after a delay of 2 to 3 frames.
    lag_s = 2.0 * TRUTH.damping_ratio / TRUTH.natural_frequency_rad_per_s
    delay_s = float(np.mean(list(values["actuation_delay"].values())))
    assert values["wheel_lag"]["time_constant_s"] == pytest.approx(lag_s, abs=0.01)
    assert values["wheel_lag"]["inertia_s"] == pytest.approx(1.0 / TRUTH.natural_frequency_rad_per_s, abs=0.01)
    assert delay_s == pytest.approx(0.05, abs=0.01)
    assert found.verdict in (Verdict.NAMED, Verdict.AMBIGUOUS)
    errors = found.held_out.errors["end_position_mm"]
    assert errors["after"] < 1.3 * errors["floor"]
    assert errors["before"] > 5.0 * errors["after"]
    assert found.model is not None
    assert not any(effect.needs_steered_axles for effect in found.model.effects)


def test_too_few_straights_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "campaign"
    with open_session(OPTIONS, out=str(path), resume=False, dry_run=False) as opened:
        for share in (-1.0, 1.0):
            opened.driver(f"drive-{share}", experiment="drive", repeat=1).hold(for_s=2.0, drive=share)
        with pytest.raises(FitError, match=r"too few different commands to calibrate: 2 \(limit: at least 4\)"):
            opened.model("calibrated")


def test_it_has_no_rear_axle(tmp_path: Path) -> None:
    with open_session(OPTIONS, out=str(tmp_path / "a"), resume=False, dry_run=False) as opened:
        driver = opened.driver("rear", experiment="free", repeat=1)
        with pytest.raises(NotDrivenError, match="does not steer its rear axle"):
            driver.hold(for_s=2.0, drive=0.5, rear=0.5)


def test_a_turn_on_the_spot_stays_on_the_spot(tmp_path: Path) -> None:
    with open_session(OPTIONS, out=str(tmp_path / "a"), resume=False, dry_run=False) as opened:
        run = opened.driver("turn", experiment="yaw_rate", repeat=1).hold(for_s=3.0, front=0.5)
    frames = run.frames
    lever = math.hypot(TRUTH.marker_forward_m, TRUTH.marker_left_m)
    assert max(np.ptp(frames.x_m), np.ptp(frames.y_m)) < 2.2 * lever
    assert float(np.ptp(np.unwrap(frames.heading_rad))) > 1.0
