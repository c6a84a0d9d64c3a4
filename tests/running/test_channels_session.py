"""A session with a steering of 0…1: straight is planned straight, and errors are those of the usual units."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from agvbench.adapters import open_rig
from agvbench.calibration import calibrate
from agvbench.campaign import Campaign
from agvbench.cli import main
from agvbench.errors import PlanError, SafetyStopError, VehicleError
from agvbench.model import VehicleModel, nominal_model
from agvbench.planning import Workspace
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.running.execution.drive import drive
from agvbench.running.links import ContinuousLink
from agvbench.running.positioning.automatic_return.returner import Returner
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.simulator.differential import DifferentialVehicle
from agvbench.statistics.run_errors import run_error
from agvbench.types import Command, Commands, Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

sys.path.insert(0, str(Path(__file__).parent))
from half_steering import CHANNELS, TURNING, HalfSteering

PLANT = "half_steering:make_half_steering"
NEUTRAL = Command(0.0, 0.5, 0.5)
SHARES = (-1.0, -0.7, -0.4, 0.4, 0.7, 1.0)
EIGHT = tuple(map(str, range(1, 9)))


def half_steered() -> VehicleModel:
    """Return the usual nominal vehicle with its commands in the channels of the plant."""
    return nominal_model("half", uncalibrated_vehicle().geometry, CHANNELS)


def drive_all(opened: BenchSession) -> None:
    for share in SHARES:
        opened.driver(f"drive{share}", experiment="drive", repeat=1).hold(for_s=3.0, drive=share, least_s=1.5)
        for axle in ("front", "rear"):
            driver = opened.driver(f"{axle}{share}", experiment=f"steering_{axle}", repeat=1)
            driver.hold(for_s=3.0, drive=1.0, **{axle: share}, least_s=1.5)
    for name in EIGHT:
        opened.driver(name, experiment="trajectory", repeat=1).trajectory(name, condition="calibrated")


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("usual") / "campaign"
    with open_session({"seed": 3}, out=str(path), resume=False, dry_run=False) as opened:
        drive_all(opened)
    return path


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("half") / "campaign"
    half_steered().save(path.with_name("half.toml"))
    options = {"seed": 3, "vehicle": str(path.with_name("half.toml")), "plant": PLANT}
    with open_session(options, out=str(path), resume=False, dry_run=False) as opened:
        drive_all(opened)
    return path


def test_the_campaign_says_what_the_vehicle_file_said(half: Path) -> None:
    assert Campaign.open(half).header.channels == CHANNELS
    assert VehicleModel.load(half / "vehicle.toml").channels == CHANNELS


def test_straight_is_planned_straight(half: Path) -> None:
    run = next(run for run in Campaign.open(half) if run.experiment == "drive")
    np.testing.assert_array_equal([run.commands.front, run.commands.rear], 0.5)
    assert run.commands.drive[0] == run.commands.drive[-1] == 0.0
    command = half_steered().command_for(0.0, 0.0, 0.32)
    assert command == (1.0, 0.5, 0.5)


def test_the_maps_are_those_of_the_usual_units(usual: Path, half: Path) -> None:
    one, other = (calibrate(path).model for path in (usual, half))
    shares = np.linspace(0.1, 0.9, 9)
    for axle in ("front", "rear"):
        np.testing.assert_allclose(
            getattr(other, axle)(shares), getattr(one, axle)(1500.0 - 1200.0 * (shares - 0.5)), atol=1e-3
        )
    speeds = np.linspace(-1.0, 1.0, 9)
    np.testing.assert_allclose(other.speed(speeds), one.speed(1500.0 - 600.0 * speeds), atol=1e-3)


def test_the_eight_are_driven_as_well_as_in_the_usual_units(usual: Path, half: Path) -> None:
    one, other = (
        {run.trajectory: run_error(run).position_mm for run in Campaign.open(path) if run.experiment == "trajectory"}
        for path in (usual, half)
    )
    assert set(other) == set(EIGHT)
    for name, error_mm in one.items():
        assert other[name] == pytest.approx(error_mm, abs=3.0), name


@pytest.mark.parametrize("stopped", [True, False], ids=["stop", "silence"])
def test_what_stops_the_vehicle_sends_each_channel_its_own_neutral(stopped: bool) -> None:
    driven = Command(0.5, 0.9, 0.2)
    with open_rig("live", plant=PLANT, channels=CHANNELS) as link:
        assert link.identity().channels == CHANNELS
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        link.control_cycle(driven, t_s=0.0, hold_s=0.2)
        if stopped:
            link.stop()
        HalfSteering.given.clear()
        until_s = time.monotonic() + 20.0
        while NEUTRAL not in HalfSteering.given and time.monotonic() < until_s:
            time.sleep(0.02)
    assert set(HalfSteering.given) <= {driven, NEUTRAL}
    assert HalfSteering.given[-1] == NEUTRAL


def test_the_supervisor_stops_what_leaves_its_floor_and_lets_stand_what_is_neutral() -> None:
    times, ones = np.array([0.0, 60.0]), np.ones(2)
    room = Workspace.circle(3.0)
    supervisor = Supervisor(room, NEUTRAL)
    with open_rig("sim", plant=PLANT, channels=CHANNELS) as link:
        standing = Commands(times, 0.0 * ones, 0.5 * ones, 0.5 * ones)
        drive(link, standing, neutral=NEUTRAL, start=Pose(0.0, 0.0, 0.0), run_key="a", supervisor=supervisor)
        driving = Commands(times, np.array([1.0, 0.0]), 0.5 * ones, 0.5 * ones)
        with pytest.raises(SafetyStopError):
            drive(link, driving, neutral=NEUTRAL, start=Pose(0.0, 0.0, 0.0), run_key="b", supervisor=supervisor)


def test_it_drives_itself_back() -> None:
    room = Workspace.circle(6.1)
    with open_rig("sim", plant=PLANT, seed=3, channels=CHANNELS) as link:
        home = Returner(ContinuousLink(link), half_steered(), room, Supervisor(room, NEUTRAL))
        link.reset(Pose(0.0, 0.2, 1.0), run_key="a")
        HalfSteering.given.clear()
        placing = home.bring_to(Pose(1.0, -0.5, 2.0))
    assert placing.attempts <= 2
    for role in ("drive", "front", "rear"):
        channel = getattr(CHANNELS, role)
        assert all(channel.holds(getattr(command, role)) for command in HalfSteering.given)


def test_a_vehicle_of_other_channels_is_refused_before_anything_moves(tmp_path: Path) -> None:
    half_steered().save(tmp_path / "half.toml")
    options = {"seed": 3, "vehicle": str(tmp_path / "half.toml"), "calibration": str(tmp_path / "other.toml")}
    uncalibrated_vehicle().save(tmp_path / "other.toml")
    with (
        pytest.raises(VehicleError, match="takes commands in another unit than its file says"),
        open_session(options | {"plant": PLANT}, out=str(tmp_path / "c"), resume=False, dry_run=False),
    ):
        pass


def test_a_command_out_of_range_moves_nothing(tmp_path: Path) -> None:
    half_steered().save(tmp_path / "half.toml")
    options = {"seed": 3, "vehicle": str(tmp_path / "half.toml"), "plant": PLANT}
    (tmp_path / "far.toml").write_text(
        'schema = 1\nname = "far"\ntarget = "none"\n\n[commands]\nunit = "normalised"\nduration_s = 1.0\n'
        "rows = [[0.0, 0.5, 1.2, 0.5]]\n"
    )
    with open_session(options, out=str(tmp_path / "c"), resume=False, dry_run=False) as opened:
        HalfSteering.given.clear()
        driver = opened.driver("far", experiment="free", repeat=1)
        with pytest.raises(PlanError, match=r"front command is out of range: 1\.2 \(limit: 0 to 1\)"):
            driver.trajectory(str(tmp_path / "far.toml"), condition="uncalibrated")
    assert not HalfSteering.given


def test_a_differential_vehicle_is_calibrated_in_its_own_channels(tmp_path: Path) -> None:
    geometry = Geometry(0.0, 0.05, kinematics="differential")
    nominal_model("turning", geometry, TURNING).save(tmp_path / "turning.toml")
    options = {"seed": 5, "vehicle": str(tmp_path / "turning.toml"), "plant": "half_steering:make_half_turning"}
    with open_session(options, out=str(tmp_path / "c"), resume=False, dry_run=False) as opened:
        for share in SHARES:
            opened.driver(f"drive{share}", experiment="drive", repeat=1).hold(for_s=3.0, drive=share)
            opened.driver(f"turn{share}", experiment="yaw_rate", repeat=1).hold(for_s=4.0, front=share)
        model = opened.model("calibrated")
        driven = opened.driver("5", experiment="trajectory", repeat=1).trajectory("5", condition="calibrated")
    assert model.channels == Campaign.open(tmp_path / "c").header.channels == TURNING
    truth = DifferentialVehicle()
    radius = 0.5 * (truth.left_radius + truth.right_radius)
    assert float(model.speed(0.3)) == pytest.approx(0.3 * radius, rel=0.005)
    yaw_rate = truth.assumed_track_m / truth.true_track_m * radius * 1.2
    np.testing.assert_allclose(model.front(np.array([0.0, 0.5, 1.0])), [-yaw_rate, 0.0, yaw_rate], atol=0.01)
    assert driven.error.position_mm < 100.0
    assert pq.read_table(tmp_path / "c" / "commands.parquet" / "5.parquet").column_names[2:] == ["speed", "yaw_rate"]


def test_an_adapter_takes_its_channels_from_a_vehicle_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    half_steered().save(tmp_path / "half.toml")
    arguments = ["agv", f"sim:{PLANT}", "--vehicle", str(tmp_path / "half.toml")]
    assert main([*arguments, "--check"]) == 0
    assert "front normalised, neutral 0.5, 0…1" in " ".join(capsys.readouterr().out.split())
    assert main([*arguments, "--neutral", "1500"]) == 2
    assert "--neutral: the vehicle file says this" in capsys.readouterr().err


def test_the_default_plant_is_refused_for_a_vehicle_whose_commands_it_does_not_take(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    vehicle = nominal_model("car", Geometry(0.15, 0.15), Channels.alike("normalised"))
    vehicle.save(tmp_path / "vehicle.toml")
    assert main(["bench", "--vehicle", "vehicle.toml"]) == 2
    said = capsys.readouterr()
    assert "the plant that is simulated by default takes pulses in µs" in said.out + said.err
    assert "--plant my_plant.py:make_plant" in said.out + said.err
