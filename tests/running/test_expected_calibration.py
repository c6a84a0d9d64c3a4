"""Before anything is measured a dry run plans what the calibrated vehicle will drive, in a folder of one's own, too."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import pytest

from agvbench.campaign import CampaignHeader
from agvbench.campaign.header import FILE_NAME
from agvbench.model import example_path, example_vehicle, thesis_vehicle
from agvbench.running.configuration.vehicles import expected_calibration, uncalibrated_vehicle
from agvbench.running.session.driver import NotDrivenError
from agvbench.running.session.opening import open_session
from agvbench.workflows.init import make_lab


def test_a_new_lab_can_plan_every_trajectory(tmp_path):
    make_lab(tmp_path / "lab")
    options = {"vehicle": str(tmp_path / "lab" / "vehicle.toml")}
    with open_session(options, out=str(tmp_path / "c"), resume=False, dry_run=True) as session:
        for name in map(str, range(1, 9)):
            assert session.plan(session.trajectory(name), "calibrated").duration_s > 0.0


def test_half_speed_is_expected_halfway_and_the_rest_is_believed(tmp_path):
    uncalibrated_vehicle().save(tmp_path / "vehicle.toml")
    expected = expected_calibration(str(tmp_path / "vehicle.toml"))
    nominal = uncalibrated_vehicle(str(tmp_path / "vehicle.toml"))
    full = nominal.drive.output_low
    assert expected.drive.inverse(full / 2.0) == pytest.approx(
        (nominal.drive.command_low + nominal.drive.command_stop) / 2.0
    )
    assert dataclasses.replace(expected, drive=nominal.drive) == nominal


def test_a_drive_that_is_known_stays(tmp_path):
    thesis_vehicle().save(tmp_path / "vehicle.toml")
    assert expected_calibration(str(tmp_path / "vehicle.toml")) == uncalibrated_vehicle(str(tmp_path / "vehicle.toml"))


def test_a_vehicle_keeps_its_name(tmp_path):
    dataclasses.replace(uncalibrated_vehicle(), name="red car").save(tmp_path / "vehicle.toml")
    options = {"vehicle": str(tmp_path / "vehicle.toml")}
    for resume in (False, True):
        with open_session(options, out=str(tmp_path / "c"), resume=resume, dry_run=False):
            assert CampaignHeader.load(tmp_path / "c" / FILE_NAME).vehicle_name == "red car"


def test_where_a_calibration_is_given_none_is_driven(tmp_path):
    command = [sys.executable, "-m", "agvbench", "bench", "--dry-run", "--trajectories", "5", "--repeats", "2"]
    given = ["--calibration", str(example_path("thesis"))]
    without, with_one = (
        subprocess.run([*command, *more], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
        for more in ([], given)
    )
    assert "steering_front" in without
    assert "steering_front" not in with_one
    assert "trajectory" in with_one


@pytest.mark.slow
def test_a_folder_with_a_car_drives_its_own_trajectory_too_and_steers_in_front(tmp_path):
    example_vehicle("front_steered").save(tmp_path / "vehicle.toml")
    (tmp_path / "trajectories").mkdir()
    text = 'schema = 1\nname = "wide"\n[[segments]]\nkind = "arc"\nturn = "left"\nradius_m = 1.5\nangle_deg = 45.0'
    (tmp_path / "trajectories" / "wide.toml").write_text(text)
    program = "import sys; from agvbench.cli import main; sys.exit(main(sys.argv[1:]))"
    command = ["bench", "trajectories", "--dry-run", "--repeats=1", "-k", "wide or 5-uncalibrated"]
    done = subprocess.run(
        [sys.executable, "-c", program, *command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 runs" in done.stdout
    for words in ("wide", "calibrated"), ("wide", "uncalibrated"), ("5", "uncalibrated"):
        assert any(set(words) <= set(line.replace("│", " ").split()) for line in done.stdout.splitlines())


def held_for(tmp_path, speed_mps, workspace="circle:6.1", **held):
    """Return how long [s] a calibration run is planned to be driven, and with which share of full command."""
    nominal = uncalibrated_vehicle()
    drive = dataclasses.replace(nominal.drive, output_low=speed_mps, output_high=-speed_mps)
    dataclasses.replace(nominal, drive=drive).save(tmp_path / "vehicle.toml")
    options = {"vehicle": str(tmp_path / "vehicle.toml"), "workspace": workspace}
    with open_session(options, out=str(tmp_path / "c"), resume=False, dry_run=True) as session:
        with pytest.raises(NotDrivenError) as reason:
            session.driver("run", experiment="steering_front", repeat=1).hold(**held)
        if str(reason.value) != "dry run":
            raise reason.value
        ((order, _),) = session.planned
    _, start_s, stop_s = order.commands.t_s
    return stop_s - start_s, (1500.0 - order.commands.drive[1]) / 600.0


ARC = {"for_s": 8.0, "drive": 1.0, "front": 0.0, "least_s": 4.0, "slower": True}


def test_calibration_runs_are_as_long_and_fast_as_the_floor_allows(tmp_path):
    assert held_for(tmp_path, 0.32, **ARC) == (8.0, 1.0)
    shorter_s, share = held_for(tmp_path, 1.0, **ARC)
    # 6.1 m less two margins, the axles and 0.35 m more for stopping; less where a trim of 1.5° bends it to either side.
    assert 4.0 < shorter_s < 4.9
    assert share == 1.0
    least_s, share = held_for(tmp_path, 3.0, **ARC)
    assert least_s == 4.0
    assert 0.30 < share < 0.40
    with pytest.raises(NotDrivenError, match="too fast for this floor: 2 s of it do not fit"):
        held_for(tmp_path, 3.0, for_s=6.0, drive=1.0, least_s=2.0)
