"""Plans of differential vehicles: the eight, turns on the spot, and what such a vehicle cannot drive."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.effects import SpeedLag, SteeringLag, WheelDiameterMismatch
from agvbench.errors import FileError, PlanError
from agvbench.model import VehicleModel, nominal_model
from agvbench.planning import THE_EIGHT, Workspace, corrected_plan, load_trajectory, plan, steered
from agvbench.planning.end_pose_prediction import Departure, rest_poses
from agvbench.planning.trajectories.loading import trajectory_from_table
from agvbench.types import Command, Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

ROBOT = nominal_model("robot", Geometry(0.0, 0.1, kinematics="differential"), Channels.alike("si"))
CENTRED = nominal_model("robot", Geometry(0.0, 0.0, kinematics="differential"), Channels.alike("si"))


def of_segments(*segments: dict, **more):
    return trajectory_from_table({"schema": 1, "name": "own", "segments": list(segments), **more})


def ends(model: VehicleModel, made) -> np.ndarray:
    return rest_poses(model, [made.commands], Departure())[0]


@pytest.mark.parametrize("name", THE_EIGHT)
def test_the_eight_end_where_the_plan_says(name):
    made = plan(steered(load_trajectory(name), "", ROBOT), ROBOT, workspace=Workspace.circle())
    x, y, heading = ends(ROBOT, made)
    assert (x, y) == pytest.approx((made.target.x_m, made.target.y_m), abs=1e-6)
    assert math.remainder(heading - made.target.heading_rad, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert Command(*made.commands.at(len(made.commands) - 1)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", ["5", "6", "7", "8"])
def test_with_markers_over_the_axle_the_full_target_is_reached(name):
    stated = load_trajectory(name).stated_target
    made = plan(steered(load_trajectory(name), "", CENTRED), CENTRED)
    assert tuple(made.target) == pytest.approx(tuple(stated), abs=1e-9)


def test_the_markers_keep_their_radius():
    made = plan(of_segments({"kind": "arc", "turn": "left", "radius_m": 0.5, "angle_deg": 180.0}), ROBOT)
    # The centroid is at the rim of a circle of 0.5 m; half a turn is its diameter.
    assert math.hypot(*made.target[:2]) == pytest.approx(1.0)


@given(angle=st.floats(1.0, 720.0), turn=st.sampled_from(["left", "right"]), ahead=st.floats(-0.3, 0.3))
def test_a_turn_on_the_spot_turns_about_the_axle(angle, turn, ahead):
    model = nominal_model("robot", Geometry(0.0, ahead, kinematics="differential"), Channels.alike("si"))
    made = plan(of_segments({"kind": "spot_turn", "turn": turn, "angle_deg": angle, "yaw_rate": 0.5}), model)
    assert made.duration_s == pytest.approx(math.radians(angle) / 0.5)
    axle = made.expected[:, 1:3] - ahead * np.column_stack([np.cos(made.expected[:, 3]), np.sin(made.expected[:, 3])])
    np.testing.assert_allclose(axle, np.tile([-ahead, 0.0], (len(axle), 1)), atol=1e-9)
    assert made.expected[-1, 3] == pytest.approx(math.radians(angle) * (1.0 if turn == "left" else -1.0))
    assert set(made.commands.drive) == {0.0}


def test_it_turns_and_drives_on_without_a_rest():
    made = plan(
        of_segments(
            {"kind": "spot_turn", "turn": "left", "angle_deg": 90.0, "yaw_rate": "half"},
            {"kind": "straight", "length_m": 0.64},
            {"kind": "pause", "duration_s": 1.0},
            {"kind": "straight", "length_m": 0.32, "direction": "backward"},
        ),
        CENTRED,
    )
    rows = [tuple(np.round(made.commands.at(i), 9)) for i in range(len(made.commands))]
    assert rows == [(0.0, 0.5, 0.0), (0.32, 0.0, 0.0), (0.0, 0.0, 0.0), (-0.32, 0.0, 0.0), (0.0, 0.0, 0.0)]
    assert made.target == pytest.approx(Pose(0.0, 0.32, math.pi / 2.0), abs=1e-9)


ARC = {"kind": "arc", "turn": "left", "angle_deg": 90.0}
LINE = {"kind": "straight", "length_m": 1.0}
TURN = {"kind": "spot_turn", "turn": "right", "angle_deg": 90.0}
REFUSED = {
    "own: segments[0]: turn radius 0.20 m at 0.32 m/s needs 1.85 rad/s (limit: 1.00 rad/s); "
    "slow down, or widen it to at least 0.34 m": {**ARC, "radius_m": 0.2},
    "turn radius is smaller than the distance of the marker centroid from the axle: 0.10 m (limit: more than 0.100 m); "
    "widen the turn, or turn on the spot": {**ARC, "radius_m": 0.1},
    "axle_angle_deg is an angle of an axle, and a differential vehicle steers none; give radius_m": {
        **ARC,
        "axle_angle_deg": 10.0,
    },
    "a differential vehicle moves along its heading only: crab_deg = 5": {**LINE, "steering": "crab", "crab_deg": 5.0},
    "speed is more than the drive reaches: 0.5 m/s": {**LINE, "speed": 0.5},
    "yaw rate is more than the vehicle reaches to the right: 1.5 rad/s (limit: 1 rad/s); "
    'turn more slowly, or say "full"': {**TURN, "yaw_rate": 1.5},
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_it_cannot_drive_is_one_line(message):
    with pytest.raises(PlanError, match=re.escape(message)):
        plan(of_segments(REFUSED[message]), ROBOT)


def test_steered_axles_do_not_turn_on_the_spot():
    thesis = nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))
    with pytest.raises(PlanError, match="a vehicle with steered axles cannot turn on the spot; drive an arc"):
        plan(of_segments({"kind": "spot_turn", "turn": "left", "angle_deg": 90.0}), thesis)


@pytest.mark.parametrize(
    ("rate", "problem"), [(-0.5, "not above zero: -0.5 rad/s"), ("fast", "not a yaw rate: 'fast'")]
)
def test_a_yaw_rate_that_is_none_is_refused(rate, problem):
    with pytest.raises(FileError, match=problem):
        of_segments({"kind": "spot_turn", "turn": "left", "angle_deg": 90.0, "yaw_rate": rate})


@pytest.mark.parametrize("name", ["1", "2", "5", "8"])
def test_a_corrected_plan_meets_the_target_in_spite_of_lags_and_unequal_wheels(name):
    effects = (SteeringLag(0.2), SpeedLag(0.15, 0.25), WheelDiameterMismatch(0.05))
    model = ROBOT.with_effects(*effects)
    made = corrected_plan(steered(load_trajectory(name), "", model), model)
    assert made.correction is not None
    assert made.correction.uncorrected.distance_m > 0.02
    x, y, heading = ends(model, made)
    assert math.hypot(x - made.target.x_m, y - made.target.y_m) < 3e-4
    assert math.remainder(heading - made.target.heading_rad, math.tau) == pytest.approx(0.0, abs=1e-3)
