"""A differential vehicle drives itself back; how near it came is read from the plant."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters import open_rig
from agvbench.campaign import Campaign
from agvbench.errors import AgvbenchError, PlacingError
from agvbench.model import VehicleModel, example_vehicle
from agvbench.model.examples import example_path
from agvbench.planning import Workspace
from agvbench.running.links import ContinuousLink
from agvbench.running.positioning.automatic_return.turn_and_drive import TurnAndDrive, _to_both_sides
from agvbench.running.session.opening import open_session
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Pose, wrap_angle
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.maps import Line
from agvbench.vehicle.wheels import Wheels

sys.path.insert(0, str(Path(__file__).parent))
import returning_plants

ROBOT = example_vehicle("differential")
WHEEL = Channel("si", 0.0, -0.3, 0.3)
BY_WHEELS = replace(ROBOT, channels=Channels.of_wheels(Wheels(WHEEL, WHEEL, track_m=0.3)))
STARTS = (Pose(1.2, 0.8, 2.5), Pose(-1.0, 0.3, 0.0), Pose(-1.0, 0.31, 0.0), Pose(0.4, -0.9, -1.6))


@contextmanager
def returner(
    plant: str, model: VehicleModel = ROBOT, room: str = "circle:6.1", seed: int = 3
) -> Iterator[tuple[ContinuousLink, TurnAndDrive]]:
    with open_rig("sim", plant=f"returning_plants:{plant}", seed=seed, channels=model.channels) as link:
        continuous, space = ContinuousLink(link), Workspace.parse(room)
        yield continuous, TurnAndDrive(continuous, model, space, Supervisor(space, model.neutral))


@pytest.mark.parametrize(
    ("plant", "model", "seed"),
    [
        ("differential", ROBOT, 3),
        ("differential", BY_WHEELS, 3),
        ("random_differential", ROBOT, 1),
        ("random_differential", ROBOT, 2),
        ("random_differential", ROBOT, 4),
    ],
)
def test_a_vehicle_comes_to_every_start(plant: str, model: VehicleModel, seed: int) -> None:
    with returner(plant, model, seed=seed) as (link, home):
        link.reset(Pose(0.0, 0.2, 1.0), run_key="a")
        for start in STARTS:
            placing = home.bring_to(start)
            x, y, heading = returning_plants.TRUE_POSES[-1]
            assert math.hypot(x - start.x_m, y - start.y_m) <= 0.005
            assert abs(wrap_angle(heading - start.heading_rad)) <= math.radians(1.0)
            assert 1 <= placing.attempts <= 6
    poses = np.array(returning_plants.TRUE_POSES)
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() < 0.05  # it drove there


def test_a_vehicle_that_stands_there_does_not_move() -> None:
    with returner("differential") as (link, home):
        link.reset(STARTS[0], run_key="a")
        placing = home.bring_to(STARTS[0])
    assert (placing.attempts, placing.duration_s) == (0, 0.5)
    assert returning_plants.TRUE_POSES[0] == returning_plants.TRUE_POSES[-1]


@pytest.mark.parametrize(
    ("plant", "model", "said"),
    [
        ("Dead", ROBOT, r"the vehicle does not move: commanded for 2 s; see to its battery"),
        (
            "differential",
            replace(ROBOT, front=Line(-1.0, 0.0, command_low=-1.2, command_high=1.2)),
            r"the vehicle moves the other way than commanded; give the right file with --vehicle",
        ),
    ],
)
def test_a_vehicle_that_does_not_do_what_it_is_told_is_stopped(plant: str, model: VehicleModel, said: str) -> None:
    with returner(plant, model) as (link, home):
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        with pytest.raises(AgvbenchError, match=said):
            home.bring_to(Pose(1.0, 1.0, 0.0))


def test_a_start_outside_the_floor_moves_nothing() -> None:
    with returner("differential", room="rectangle:2x2") as (link, home):
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        with pytest.raises(PlacingError, match=r"rectangle:2x2: .*cannot drive back .*: the start is 0.50 m outside"):
            home.bring_to(Pose(1.5, 0.0, 0.0))
    assert returning_plants.TRUE_POSES[0] == returning_plants.TRUE_POSES[-1]


def test_a_session_needs_nobody(tmp_path: Path) -> None:
    options = {
        "vehicle": str(example_path("differential")), "plant": "agvbench.simulator:differential_plant", "seed": 5,
        "place": "auto",
    }  # fmt: skip
    with open_session(options, out=str(tmp_path / "a"), resume=False, dry_run=False) as opened:
        for name in ("5", "6"):
            opened.driver(name, experiment="trajectory", repeat=1).trajectory(name, condition="uncalibrated")
    runs = Campaign.open(tmp_path / "a").runs
    assert runs["status"].tolist() == ["ok", "ok"]
    assert runs["placing_attempts"].iloc[1] >= 1
    assert (runs["placing_position_error_m"] <= 0.004).all()


@pytest.mark.parametrize("reached", [(0.0, 0.6), (-0.5, -0.1)])
def test_a_vehicle_that_drives_one_way_only_cannot_come_back(reached):
    with pytest.raises(PlacingError, match="the vehicle cannot drive forward and backward"):
        _to_both_sides("drive forward and backward", reached)
    assert _to_both_sides("turn", (-0.5, 0.6)) == 0.5
