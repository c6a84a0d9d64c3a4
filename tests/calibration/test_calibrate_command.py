"""``agvbench calibrate`` on a campaign directory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import FRONT_M, REAR_M, Vehicle
from test_calibrate import PLAN, STEPS, drive_all, front, rear, speed

from agvbench.campaign import CampaignHeader, CampaignWriter
from agvbench.cli import main
from agvbench.model import Prior, VehicleModel, thesis_vehicle
from agvbench.vehicle.channels import Channels

HEADER = CampaignHeader(1, "tonight", "agv1", FRONT_M, REAR_M, Channels.alike("us"), 60.0)


@pytest.fixture(scope="module")
def runs():
    return [replace(run, started_s=float(k)) for k, run in enumerate(drive_all(Vehicle(front, rear, speed), PLAN))]


def written(path, runs):
    writer = CampaignWriter.create(path, HEADER)
    for run in runs:
        writer.append(run)
    return path


@pytest.fixture(scope="module")
def campaign(tmp_path_factory, runs):
    return written(tmp_path_factory.mktemp("calibrate") / "campaign", runs)


def test_prints_both_fits_and_what_was_left_out_and_writes_the_vehicle(campaign, tmp_path, capsys):
    out = tmp_path / "deep" / "vehicle.toml"
    assert main(["calibrate", str(campaign), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    for word in ("thesis", "line with end stops", "dead band refined", "cubic", "R²", "predicted"):
        assert word in printed
    assert "front: 900 (40.1°) not on the line: at the end stop" in printed
    assert all(len(line) <= 80 for line in printed.splitlines() if "●" in line)
    model = VehicleModel.load(out)
    assert model.calibration_hash in printed
    assert float(model.front(1400.0)) == pytest.approx(front(1400.0), abs=0.005)


def test_priors_of_the_campaign_and_of_a_replaced_vehicle_file_are_kept(runs, campaign, tmp_path, capsys):
    latency = Prior("mocap_latency", "latency_s", 0.008, 0.001, "data sheet")
    out = tmp_path / "vehicle.toml"
    replace(thesis_vehicle(), priors=(latency,)).save(out)
    assert main(["calibrate", str(campaign), "--out", str(out)]) == 0
    assert VehicleModel.load(out).priors == (latency,)
    assert VehicleModel.load(out).name == "agv1"
    own = written(tmp_path / "own", runs)
    scale = Prior("mocap_scale", "scale", 0.0, 0.0005, "wand")
    replace(thesis_vehicle(), priors=(scale,)).save(own / "vehicle.toml")
    assert main(["calibrate", str(own), "--out", str(out)]) == 0
    assert VehicleModel.load(out).priors == (scale,)


def test_maps_of_the_thesis_on_request(campaign, tmp_path, capsys):
    out = tmp_path / "vehicle.toml"
    assert main(["calibrate", str(campaign), "--maps", "thesis", "--out", str(out)]) == 0
    assert "front: 900 (40.1°) left out: the outermost command at each end" in capsys.readouterr().out
    assert [VehicleModel.load(out).front.kind, VehicleModel.load(out).drive.kind] == ["line", "cubic"]


def test_what_cannot_be_calibrated_is_one_line_and_exit_code_2(runs, campaign, tmp_path, capsys):
    few = written(tmp_path / "few", [run for run in runs if run.experiment != "steering_front"][: len(STEPS) + 2])
    rejected = written(tmp_path / "rejected", [replace(run, status="rejected: lost") for run in runs])
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    cases = {
        (str(tmp_path / "nowhere"),): "does not exist",
        (str(few),): "drive: too few different commands to calibrate: 2 (limit: at least 4)",
        (str(rejected),): "no calibration run can be measured",
        (str(campaign), "--session", "monday"): "no run belongs to this session: 'monday'",
        (str(campaign), "--out", str(blocked / "vehicle.toml")): "cannot be written",
    }
    for arguments, message in cases.items():
        assert main(["calibrate", *arguments]) == 2
        told = capsys.readouterr().err
        assert told.startswith("agvbench calibrate: ")
        assert message in told
        assert told.count("\n") == 1


def test_measurements_reach_the_report(campaign):
    from agvbench.calibration import calibrate
    from agvbench.campaign import Campaign
    from agvbench.workflows.calibration import read_calibration_curves

    calibration = calibrate(Campaign.open(campaign))
    calibration.model.save(campaign / "vehicle.toml")
    CampaignWriter.resume(campaign, HEADER).write_table("calibration", calibration.measurements)
    curves = read_calibration_curves(Campaign.open(campaign)).curves
    assert [curve.axle for curve in curves] == ["front", "rear", "drive"]
    for curve in curves:
        used = ~curve.left_out
        assert np.max(np.abs(curve.value[used] - curve.fitted[used])) < (0.6 if curve.axle != "drive" else 0.004)
