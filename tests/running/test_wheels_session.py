"""A session with a vehicle that is commanded by two wheel speeds: it drives as the one with a speed and a yaw rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow.parquet as pq
import pytest

from agvbench.adapters import open_rig
from agvbench.adapters.agv.live import LiveAgv
from agvbench.adapters.contract import AdapterOptions
from agvbench.bus.messages.command import CommandMessage
from agvbench.campaign import Campaign
from agvbench.control.motion import Actuation, Motion
from agvbench.errors import VehicleError
from agvbench.model import VehicleModel, example_vehicle
from agvbench.running.session.opening import open_session
from agvbench.running.session.rig_checks import check_commands
from agvbench.simulator import differential_plant
from agvbench.statistics.run_errors import run_error
from agvbench.types import Command
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.wheels import WheelCommand, Wheels

PLANT = "agvbench.simulator:differential_plant"
METRES = Wheels(Channel("si", 0.0, -0.55, 0.55), Channel("si", 0.0, -0.55, 0.55), track_m=0.3)
NAMES = ("1", "5", "6")


def commanded_by(wheels: Wheels) -> VehicleModel:
    """Return the example vehicle with wheel commands in place of a speed and a yaw rate."""
    return replace(example_vehicle("differential"), channels=Channels.of_wheels(wheels))


def drive_some(vehicle: Path, out: Path) -> dict[str, float]:
    """Drive a session; return the end position error of each trajectory [mm]."""
    options = {"vehicle": str(vehicle), "plant": PLANT, "seed": 5}
    with open_session(options, out=str(out), resume=False, dry_run=False) as opened:
        for share in (-1.0, -0.6, -0.3, 0.3, 0.6, 1.0):
            opened.driver(f"drive{share}", experiment="drive", repeat=1).hold(for_s=3.0, drive=share)
            opened.driver(f"turn{share}", experiment="yaw_rate", repeat=1).hold(for_s=3.0, front=share)
        for name in NAMES:
            opened.driver(name, experiment="trajectory", repeat=1).trajectory(name, condition="calibrated")
    return {run.trajectory: run_error(run).position_mm for run in Campaign.open(out) if run.experiment == "trajectory"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheels")
    example_vehicle("differential").save(path / "body.toml")
    commanded_by(METRES).save(path / "wheels.toml")
    return path


@pytest.mark.slow
def test_it_drives_as_the_same_vehicle_with_body_commands(folder: Path) -> None:
    body = drive_some(folder / "body.toml", folder / "body")
    wheels = drive_some(folder / "wheels.toml", folder / "wheels")
    assert set(wheels) == set(NAMES)
    for name, error_mm in body.items():
        assert wheels[name] == pytest.approx(error_mm, abs=0.5), name
    header = Campaign.open(folder / "wheels").header
    assert header.channels == VehicleModel.load(folder / "wheels/vehicle.toml").channels == Channels.of_wheels(METRES)
    table = pq.read_table(folder / "wheels/commands.parquet").to_pandas()
    assert {"left", "right"} == {*table} & {"left", "right", "speed", "yaw_rate", "drive", "front"}
    turns = table[table["run_id"].str.startswith("turn") & (table["left"] != 0.0)]
    np.testing.assert_allclose(turns["left"], -turns["right"], atol=1e-12)


def test_a_vehicle_that_says_otherwise_is_refused(folder: Path) -> None:
    other = replace(METRES, track_m=0.31)
    with (
        open_rig("sim", plant=PLANT, channels=Channels.of_wheels(other)) as link,
        pytest.raises(VehicleError, match=r"other wheel commands than its file says: .*track 0.3 m .*track 0.31 m"),
    ):
        check_commands({"uncalibrated": commanded_by(METRES)}, link.identity())


def test_a_run_beyond_a_wheel_is_not_driven_and_says_which(folder: Path) -> None:
    slow = replace(METRES, left=Channel("si", 0.0, -0.4, 0.4), right=Channel("si", 0.0, -0.4, 0.4))
    commanded_by(slow).save(folder / "slow.toml")
    options = {"vehicle": str(folder / "slow.toml"), "plant": PLANT, "seed": 5}
    with open_session(options, out=str(folder / "slow"), resume=False, dry_run=False) as opened:
        opened.driver("a", experiment="free", repeat=1).hold(for_s=1.0, drive=1.0)
        with pytest.raises(VehicleError, match=r"run b|b: right wheel command is out of its channel's range: 0.53"):
            opened.driver("b", experiment="free", repeat=1).hold(for_s=1.0, drive=1.0, front=1.0)
    assert [run.run_id for run in Campaign.open(folder / "slow")] == ["a"]


class WheelAgv(LiveAgv):
    """A real vehicle's adapter: it sends wheel commands, here to a list."""

    scheme = "wheel-agv"
    sent: ClassVar[list[WheelCommand]] = []

    def apply(self, message: CommandMessage) -> None:
        wheels = self._options.channels.wheels
        assert wheels is not None
        self.sent.append(wheels.command(message.command))
        super().apply(message)

    def stop(self) -> None:
        wheels = self._options.channels.wheels
        assert wheels is not None
        self.sent.append(wheels.neutral)
        super().stop()


PULSES = Wheels(Channel("us", 1500.0, 1000.0, 2000.0), Channel("us", 1480.0, 1000.0, 1960.0))


def test_an_adapter_gets_wheel_commands_and_a_stop_sends_each_its_own_neutral() -> None:
    adapter = WheelAgv(differential_plant(0), AdapterOptions(channels=Channels.of_wheels(PULSES)))
    try:
        adapter.apply(CommandMessage(1, 0.0, Command(100.0, 50.0, 0.0), 0.1))
        adapter.apply(CommandMessage(2, 0.1, Command(400.0, 400.0, 0.0), 0.1))
        adapter.stop()
    finally:
        adapter.close()
    assert WheelAgv.sent[0] == (1550.0, 1630.0)
    assert WheelAgv.sent[1] == pytest.approx((1500.0, 1960.0))  # of 800 µs 480 are left: both slow down to 60 %
    assert WheelAgv.sent[2] == (1500.0, 1480.0)


def test_a_controller_in_closed_loop_keeps_the_curvature_where_a_wheel_saturates() -> None:
    slow = replace(METRES, left=Channel("si", 0.0, -0.3, 0.3), right=Channel("si", 0.0, -0.3, 0.3))
    command = Actuation(commanded_by(slow), "front").command(Motion(0.25, 2.0))
    assert command.front / command.drive == pytest.approx(2.0)
    assert max(slow.command(command)) == pytest.approx(0.3)
    assert command.drive == pytest.approx(0.3 / 1.3)
