"""Whole campaigns of a vehicle whose truth is known: a kinematic generator, simulated plants, measured recordings."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import FRONT_M, REAR_M, Vehicle, held, run_of

from agvbench import simulator
from agvbench.calibration import calibrate
from agvbench.errors import FitError, InputError, VehicleError
from agvbench.model import VehicleModel
from agvbench.types import Commands, Run
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

STEPS = np.arange(-600.0, 601.0, 200.0)


@dataclass(frozen=True)
class Header:
    name: str = "tonight"
    vehicle_name: str = "agv1"
    front_axle_m: float = FRONT_M
    rear_axle_m: float = REAR_M
    channels: Channels = Channels.alike("us")  # noqa: RUF009

    @property
    def neutral(self):
        return self.channels.neutral

    @property
    def geometry(self) -> Geometry:
        return Geometry(self.front_axle_m, self.rear_axle_m)


class Runs(list):
    """A campaign in memory."""

    def __init__(self, runs, **header):
        super().__init__(runs)
        self.header = Header(**header)


def front(command):
    return float(np.clip(-0.0015 * (command - 1482), -0.72, 0.70))


def rear(command):
    return float(np.clip(-0.0013 * (command - 1520), -0.69, 0.66))


def speed(command):
    y = max(abs(1500.0 - command) - 40.0, 0.0)
    return float(np.copysign(min(0.32, 0.5 * y / (y + 150.0)), 1500.0 - command))


def drive_all(vehicle, plan, repeats=1, seed=0, for_s=4.0):
    """Drive every (experiment, drive, front, rear) of `plan`."""
    rng = np.random.default_rng(seed)
    runs = []
    for repeat in range(repeats):
        for k, (experiment, *command) in enumerate(plan):
            commands = held(*command, for_s=for_s)
            frames = vehicle.frames(commands, rng, until_s=for_s + 1.0, rate_hz=60.0)
            runs.append(run_of(commands, frames, f"{experiment}-{k}-r{repeat}", experiment, repeat=repeat))
    return runs


PLAN = [
    *(("steering_front", 900, 1500 + s, 1500) for s in STEPS),
    *(("steering_rear", 900, 1500, 1500 + s) for s in STEPS),
    *(("drive", 1500 + s, 1500, 1500) for s in np.arange(-600.0, 601.0, 100.0)),
]


@pytest.fixture(scope="module")
def runs():
    return drive_all(Vehicle(front, rear, speed), PLAN)


def test_the_maps_of_a_vehicle_are_recovered(runs):
    model = calibrate(Runs(runs)).model
    fine = np.arange(900.0, 2101.0, 10.0)
    assert model.front(fine) == pytest.approx([front(c) for c in fine], abs=np.radians(0.35))
    assert model.rear(fine) == pytest.approx([rear(c) for c in fine], abs=np.radians(0.35))
    at = np.arange(900.0, 2101.0, 100.0)
    assert model.drive(at) == pytest.approx([speed(c) for c in at], abs=0.002)
    assert float(model.drive(1500.0)) == 0.0
    assert model.command_for(0.2, -0.1, 0.3).front == pytest.approx(1482 - 0.2 / 0.0015, abs=1.5)


def test_the_maps_of_the_thesis_are_a_line_and_a_cubic(runs):
    calibration = calibrate(Runs(runs), maps="thesis")
    assert [calibration.model.front.kind, calibration.model.rear.kind] == ["line", "line"]
    assert calibration.model.drive.kind == "cubic"
    assert calibration.model.provenance["front_left_out"] == "900, 2100"
    assert any("left out as in the thesis" in word for word in calibration.warnings)
    default = calibrate(Runs(runs))
    for role in ("front", "rear", "drive"):
        assert default.fits[role][default.chosen[role]].rms_all < default.fits[role]["thesis"].rms_all


def test_measurements_are_the_table_of_the_campaign(runs):
    table = calibrate(Runs(runs)).measurements
    assert list(table.columns) == ["axle", "command", "value", "stderr", "run_id", "left_out", "why"]
    assert set(table["axle"]) == {"front", "rear", "drive"}
    at_900 = table[(table["axle"] == "front") & (table["command"] == 900.0)]
    assert at_900["value"].to_numpy() == pytest.approx(np.degrees(0.70), abs=0.2)
    assert np.all(at_900["stderr"] < 0.1)


def test_the_same_campaign_gives_the_same_bytes(runs, tmp_path):
    for name in ("a", "b"):
        calibrate(Runs(runs)).model.save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    model = VehicleModel.load(tmp_path / "a")
    assert model.provenance["campaign"] == "tonight"
    assert model.provenance["runs_used"] == len(runs)


def test_spoilt_runs_cost_little_and_are_told(runs):
    spoilt = list(runs)
    spoilt[3] = replace(spoilt[3], status="rejected: gap of 0.40 s")
    spoilt[9] = replace(spoilt[9], frames=spoilt[9].frames.select(np.arange(5)))
    calibration = calibrate(Runs(spoilt))
    told = "\n".join(calibration.warnings)
    assert f"run {spoilt[3].run_id} left out: rejected: gap of 0.40 s" in told
    assert f"run {spoilt[9].run_id} left out: too few frames to measure" in told
    assert calibration.model.front(1300.0) == pytest.approx(front(1300.0), abs=0.005)


def test_held_out_runs_are_left_alone(runs):
    marked = [replace(run, split="held_out" if run.run_id.endswith("-0-r0") else "fit") for run in runs]
    calibration = calibrate(Runs(marked))
    assert len(calibration.fits["front"]["line"].points) == len(STEPS) - 1
    assert calibration.model.provenance["runs_used"] == len(runs) - 1


def test_drive_runs_in_turns_are_left_out_of_the_map(runs):
    lossy = Vehicle(front, rear, lambda c: 0.7 * speed(c))
    more = drive_all(lossy, [("drive", 900, 1100, 1900), ("drive", 1300, 1100, 1500)], seed=3)
    more = [replace(run, run_id=f"turn-{run.run_id}") for run in more]
    calibration = calibrate(Runs([*runs, *more]))
    assert "drive: 2 samples left out: driven in a turn" in "\n".join(calibration.warnings)
    assert float(calibration.model.drive(900.0)) == pytest.approx(0.32, abs=0.002)


def test_opposite_steering_alone_calibrates_both_axles():
    plan = [("steering_opposite", 900, 1500 + s, 1500 - s) for s in STEPS] + PLAN[2 * len(STEPS) :]
    model = calibrate(Runs(drive_all(Vehicle(front, rear, speed), plan))).model
    for command in (1100.0, 1300.0, 1700.0):
        assert float(model.front(command)) == pytest.approx(front(command), abs=0.005)
        assert float(model.rear(command)) == pytest.approx(rear(command), abs=0.005)


def test_a_vehicle_that_steers_only_in_front(tmp_path):
    vehicle = Vehicle(front, lambda c: 0.01, speed)
    plan = [entry for entry in PLAN if entry[0] != "steering_rear"]
    calibration = calibrate(Runs(drive_all(vehicle, plan)))
    assert calibration.chosen["rear"] == "fixed"
    assert float(calibration.model.rear(1500.0)) == pytest.approx(0.01, abs=2e-3)
    assert any("rear: its command never varied" in word for word in calibration.warnings)
    calibration.model.save(tmp_path / "vehicle.toml")
    assert VehicleModel.load(tmp_path / "vehicle.toml") == calibration.model


def free_runs(count=6, seed=0, gain=1.0, session="a", neutral=0.0, both_ways=False):
    """Drive with commands that never rest: normalised unit, steering in front only."""
    rng = np.random.default_rng(seed)
    runs = []
    for k in range(count):
        t = np.arange(0.0, 20.0, 0.1)
        steer = np.clip(0.9 * np.sin(2 * np.pi * t / rng.uniform(8, 15) + rng.uniform(0, 6)), -1, 1)
        throttle = 0.3 + 0.08 * np.sin(2 * np.pi * t / rng.uniform(7, 11) + rng.uniform(0, 6))
        throttle[t < 0.5] = 0.0
        if both_ways and k % 2:
            throttle = -throttle
        commands = Commands(t, neutral + throttle, neutral + steer, np.full(len(t), neutral))
        vehicle = Vehicle(
            lambda c: 0.38 * np.tanh(1.2 * (c - neutral)),
            lambda c: 0.0,
            lambda c: gain * np.sign(c - neutral) * max(abs(c - neutral) - 0.1, 0.0) * 3.0,
            speed_lag_s=0.4,
            steering_lag_s=0.12,
            front_m=0.06,
            rear_m=0.115,
        )
        frames = vehicle.frames(commands, rng, until_s=20.0, rate_hz=50.0)
        runs.append(run_of(commands, frames, f"free-{session}-{k}", "free", session=session))
    return runs


NORMALISED = {"front_axle_m": 0.06, "rear_axle_m": 0.115, "channels": Channels.alike("normalised")}


@pytest.fixture(scope="module")
def free():
    return free_runs()


def test_free_driving_is_calibrated_by_windows(free):
    calibration = calibrate(Runs(free, **NORMALISED))
    fine = np.linspace(-0.8, 0.8, 33)
    assert calibration.model.front(fine) == pytest.approx(0.38 * np.tanh(1.2 * fine), abs=0.02)
    at = np.linspace(0.24, 0.37, 8)
    assert calibration.model.drive(at) == pytest.approx(3.0 * (at - 0.1), rel=0.06)
    assert float(calibration.model.drive(0.0)) == 0.0
    assert calibration.chosen["rear"] == "fixed"
    assert calibration.model.provenance["method"] == "windows of free driving"


def test_free_driving_both_ways_has_a_dead_band():
    model = calibrate(Runs(free_runs(both_ways=True, seed=4), **NORMALISED)).model
    assert model.drive.kind == "dead_band_with_saturation"
    assert float(model.drive(-0.35)) == pytest.approx(-0.75, rel=0.06)
    assert float(model.drive(0.35)) == pytest.approx(0.75, rel=0.06)


def test_sessions_that_differ_are_told_and_can_be_taken_one_by_one(free):
    mixed = Runs([*free, *free_runs(count=3, seed=9, gain=0.5, session="b")], **NORMALISED)
    calibration = calibrate(mixed)
    told = "\n".join(calibration.warnings)
    assert "one command gives other speeds in other sessions (b 0.5" in told
    assert float(calibration.model.drive(0.35)) == pytest.approx(0.75, rel=0.06)
    alone = calibrate(mixed, session="b").model
    assert float(alone.drive(0.35)) == pytest.approx(0.375, rel=0.06)


def test_campaigns_that_do_not_determine_a_vehicle_are_one_clear_line(runs):
    with pytest.raises(FitError, match="campaign tonight: has neither calibration runs nor free driving"):
        calibrate(Runs([]))
    with pytest.raises(FitError, match="has neither calibration runs nor free driving"):
        calibrate(Runs([replace(runs[0], experiment="endurance")]))
    few = [run for run in runs if run.experiment != "steering_front"]
    few += [run for run in runs if run.experiment == "steering_front"][:2]
    with pytest.raises(FitError, match=r"campaign tonight: front: too few different commands.*: 3 \(limit: at least 4"):
        calibrate(Runs(few))
    no_drive = [run for run in runs if run.experiment != "drive"]
    with pytest.raises(FitError, match="campaign tonight: drive: too few different commands"):
        calibrate(Runs(no_drive))
    with pytest.raises(FitError, match=r"no calibration run can be measured: 0 of .*rejected: lost"):
        calibrate(Runs([replace(run, status="rejected: lost") for run in runs]))
    with pytest.raises(InputError, match="unknown maps: 'best'"):
        calibrate(Runs(runs), maps="best")
    with pytest.raises(InputError, match="no run belongs to this session: 'monday'"):
        calibrate(Runs(runs), session="monday")
    with pytest.raises(VehicleError, match="front_axle_m"):
        calibrate(Runs(runs, front_axle_m=-0.1))


def simulated(seed):
    """Drive the calibration of a simulated plant, seen by a simulated camera."""
    plant, camera, rng = simulator.make_plant(seed), simulator.Camera(), np.random.default_rng(seed)
    runs = []
    for k, (experiment, *command) in enumerate(PLAN):
        commands = held(*command, for_s=5.0)
        plant.reset((0.0, 0.0, 0.3), seed=1000 * seed + k)
        times = np.arange(0, 6.0, 1 / 120)
        poses = []
        for t in times:
            row = int(np.searchsorted(commands.t_s, t + 1e-9, side="right")) - 1
            poses.append(plant.advance(*commands.at(row), 1 / 120))
        frames = camera.observe(times + 1 / 120, np.array(poses), rng)
        runs.append(run_of(commands, frames, f"{experiment}-{k}", experiment))
    return runs


def test_a_simulated_plant_is_calibrated_to_the_thesis_tables_it_was_built_from():
    model = calibrate(Runs(simulated(1))).model
    # Table 7.1, 7.2 (the plant has them but for a lever arm of 4 mm and play) and table 7.4.
    assert np.degrees(model.front([1200.0, 1400.0, 1600.0, 1800.0])) == pytest.approx(
        [24.75, 7.57, -9.72, -26.61], abs=0.9
    )
    assert np.degrees(model.rear([1200.0, 1400.0, 1600.0, 1800.0])) == pytest.approx(
        [24.01, 7.14, -11.3, -28.99], abs=0.9
    )
    assert model.drive([900.0, 1300.0, 1400.0, 1500.0, 1700.0, 2100.0]) == pytest.approx(
        [0.322, 0.260, 0.160, 0.0, -0.243, -0.323], abs=0.012
    )


MEASURED = Path(os.environ.get("AGVBENCH_MEASURED", Path(__file__).parents[3] / "shared" / "measured")) / "dart"


@pytest.mark.slow
@pytest.mark.skipif(not MEASURED.is_dir(), reason="no measured recordings (AGVBENCH_MEASURED)")
def test_measured_free_driving_gives_a_vehicle_like_the_real_one(tmp_path):
    from agvbench.campaign import import_recordings

    campaign = import_recordings("dart", sorted(MEASURED.glob("steering_sweep_*.csv")), tmp_path / "dart")
    model = calibrate(campaign).model
    assert model.channels == Channels.alike("normalised")
    # A car of 0.175 m wheelbase: +1 turns left; its tightest circles have a radius of about half a metre.
    low, high = model.front.output_range
    assert model.front.is_rising
    assert 0.28 < high < 0.40
    assert -0.48 < low < -0.32
    assert abs(float(model.front(0.0))) < 0.03
    assert abs(float(model.rear(0.0))) < 0.03
    # Straight ahead at throttle 0.25 it did 0.51 m/s on that day.
    assert float(model.drive(0.25)) == pytest.approx(0.51, abs=0.08)
    assert isinstance(next(iter(campaign)), Run)


def test_a_short_sweep_is_calibrated_or_refused_in_one_line():
    """None of the levels of a single sweep is held for long."""
    t_s = np.arange(0.0, 10.0, 0.02)
    commands = Commands(t_s, np.full(len(t_s), 0.35), np.linspace(-0.8, 0.8, len(t_s)), np.zeros(len(t_s)))
    vehicle = Vehicle(lambda c: 0.4 * c, lambda c: 0.0, lambda c: 2.0 * c, front_m=0.06, rear_m=0.115)
    frames = vehicle.frames(commands, np.random.default_rng(0), until_s=10.0, rate_hz=50.0)
    with pytest.raises(FitError, match="too few different commands"):
        calibrate(Runs([run_of(commands, frames, "sweep", "free")], **NORMALISED))
