"""Vehicles drive themselves back; how near they came is read from the plant, which knows nothing of the controller."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters import open_rig
from agvbench.errors import AgvbenchError, PlacingError, SafetyStopError
from agvbench.model import VehicleModel, nominal_model, thesis_vehicle
from agvbench.planning import Workspace
from agvbench.planning.shortest_paths.return_path import GearLeg
from agvbench.running.links import ContinuousLink
from agvbench.running.positioning.automatic_return.leg_drive import Follower
from agvbench.running.positioning.automatic_return.returner import Returner
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Command, Pose, wrap_angle
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

sys.path.insert(0, str(Path(__file__).parent))
import returning_plants

NOMINAL = nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))
SMALL = nominal_model("car", Geometry(0.060, 0.115), Channels.alike("normalised"), rear_steered=False)
STARTS = (Pose(1.2, 0.8, 2.5), Pose(-1.0, 0.3, 0.0), Pose(-1.0, -0.9, -1.6), Pose(0.0, 0.0, 3.1))


@contextmanager
def returner(
    plant: str, model: VehicleModel = NOMINAL, room: str = "circle:6.1"
) -> Iterator[tuple[ContinuousLink, Returner]]:
    spec = f"returning_plants:{plant}"
    with open_rig("sim", plant=spec, seed=3, channels=model.channels) as link:
        continuous, space = ContinuousLink(link), Workspace.parse(room)
        yield continuous, Returner(continuous, model, space, Supervisor(space, model.neutral))


@pytest.mark.parametrize(
    ("plant", "model", "room"),
    [
        ("default", thesis_vehicle(), "polygon:-1.9,-1.6 1.9,-1.6 2.2,1.5 -1.9,1.5"),
        ("small", SMALL, "ellipse:5x4"),
        ("slack", NOMINAL, "circle:6.1"),
        ("late", NOMINAL, "circle:6.1"),
    ],
)
def test_a_vehicle_comes_to_every_start(plant: str, model: VehicleModel, room: str) -> None:
    with returner(plant, model, room) as (link, home):
        link.reset(Pose(0.0, 0.2, 1.0), run_key="a")
        for start in STARTS[:3]:
            placing = home.bring_to(start)
            x, y, heading = returning_plants.TRUE_POSES[-1]
            assert math.hypot(x - start.x_m, y - start.y_m) <= 0.005
            assert abs(wrap_angle(heading - start.heading_rad)) <= math.radians(1.0)
            assert placing.attempts >= 1
            assert placing.position_error_m == pytest.approx(math.hypot(x - start.x_m, y - start.y_m), abs=5e-4)
        assert link.passed_s > 30.0
    poses = np.array(returning_plants.TRUE_POSES)
    assert Workspace.parse(room).clearances(poses[:, :2]).min() > 0.0
    # It drove there: between two frames it is nowhere else.
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() < 0.05


def test_a_vehicle_that_stands_there_does_not_move() -> None:
    with returner("default") as (link, home):
        link.reset(STARTS[0], run_key="a")
        placing = home.bring_to(STARTS[0])
    assert (placing.attempts, placing.duration_s) == (0, 0.5)
    assert returning_plants.TRUE_POSES[0] == returning_plants.TRUE_POSES[-1]


@pytest.mark.parametrize(
    ("plant", "error", "said"),
    [
        ("Dead", PlacingError, r"the vehicle does not move: full drive for 2 s; see to its battery"),
        ("Contrary", PlacingError, r"the vehicle drives the other way than commanded; give the right file"),
        ("Swapped", SafetyStopError, r"pose jumped: 0.8\d m from where the vehicle was going"),
    ],
)
def test_a_vehicle_that_does_not_do_what_it_is_told_is_stopped(
    plant: str, error: type[AgvbenchError], said: str
) -> None:
    with returner(plant) as (link, home):
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        with pytest.raises(error, match=said):
            home.bring_to(Pose(1.5, 0.0, 0.0))


def test_where_there_is_no_way_nothing_moves() -> None:
    with returner("default", room="rectangle:1.2x0.8") as (link, home):
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        with pytest.raises(PlacingError, match=r"rectangle:1.2x0.8: the vehicle cannot drive back to its start"):
            home.bring_to(Pose(0.0, 0.0, 3.0))
    assert returning_plants.TRUE_POSES[0] == returning_plants.TRUE_POSES[-1]


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("offset_m", [-0.05, 0.05])
def test_errors_die_off_without_overshoot_in_either_gear(offset_m: float, *, backward: bool) -> None:
    along, sign = np.linspace(0.0, 3.0, 601), -1.0 if backward else 1.0
    points = np.column_stack([sign * along, np.zeros((601, 2))])
    follower = Follower(GearLeg(points, along, np.zeros(601), backward), 0.2)
    x, y, heading, offsets = 0.0, offset_m, 0.0, []
    for _ in range(1400):
        curvature = follower.guide(Pose(x, y, heading), 0.0).curvature_per_m
        heading += sign * 0.001 * curvature
        x, y = x + sign * 0.001 * math.cos(heading), y + sign * 0.001 * math.sin(heading)
        offsets.append(y / offset_m)
    # (1 + s/ℓ) exp(−s/ℓ) at s = 7 ℓ
    assert offsets[-1] == pytest.approx(8.0 * math.exp(-7.0), abs=0.002)
    assert min(offsets) > -1e-3


def test_time_goes_on_where_a_clock_begins_anew() -> None:
    neutral = Command(1500.0, 1500.0, 1500.0)
    with open_rig("sim", seed=3) as direct:
        link = ContinuousLink(direct)
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        first = link.control_cycle(neutral, t_s=-0.5, hold_s=1.5)
        second = link.control_cycle(neutral, t_s=-0.25, hold_s=1.0)
    assert first.t_s[0] < -0.49
    assert second.t_s[-1] < 0.75
    assert second.t_s[0] + 1.25 == pytest.approx(first.t_s[-1] + 1.0 / 120.0, abs=0.02)
    assert second.frame[0] > first.frame[-1]
