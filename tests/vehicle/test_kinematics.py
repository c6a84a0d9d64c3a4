"""The signs of the kinematics by a rigid-body argument, and the inverse by round trips."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.errors import VehicleError
from agvbench.vehicle.geometry import Driven, Geometry
from agvbench.vehicle.kinematics import axle_angles, body_motion, body_velocity, wheel_speed

THESIS = Geometry(front_axle_m=0.181, rear_axle_m=0.121)
angle = st.floats(-1.2, 1.2)
length = st.floats(0.02, 3.0)
speed = st.floats(0.01, 5.0) | st.floats(-5.0, -0.01)

MODES = {"straight": (0.0, 0.0), "crab": (1.0, 1.0), "front": (1.0, 0.0), "rear": (0.0, 1.0), "opposite": (1.0, -1.0)}


def velocity_at(point_x: float, forward: float, left: float, yaw_rate: float) -> tuple[float, float]:
    """v + ω × r for a point on the centre line: ω ẑ × x x̂ = ω x ŷ."""
    return forward, left + yaw_rate * point_x


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("turn_rad", [math.radians(25.0), math.radians(-25.0)])
@pytest.mark.parametrize("drive_mps", [0.3, -0.3])
def test_axle_points_move_along_their_wheels(mode: str, turn_rad: float, drive_mps: float) -> None:
    front, rear = (share * turn_rad for share in MODES[mode])
    # In a rigid body both axle points share their speed along the body, so only one speed is free.
    front_mps, rear_mps = drive_mps, drive_mps * math.cos(front) / math.cos(rear)
    v, beta, yaw_rate = (float(x) for x in body_motion(front, rear, front_mps, rear_mps, THESIS))
    forward, left = v * math.cos(beta), v * math.sin(beta)
    for x, delta, axle_mps in ((0.181, front, front_mps), (-0.121, rear, rear_mps)):
        vx, vy = velocity_at(x, forward, left, yaw_rate)
        across = -math.sin(delta) * vx + math.cos(delta) * vy
        along = math.cos(delta) * vx + math.sin(delta) * vy
        assert across == pytest.approx(0.0, abs=1e-15)
        assert along == pytest.approx(axle_mps, abs=1e-15)


@pytest.mark.parametrize(
    ("mode", "yaw_sign", "left_sign"),
    [("crab", 0, 1), ("front", 1, 1), ("rear", -1, 1), ("opposite", 1, -1), ("straight", 0, 0)],
)
def test_turning_left_looks_as_it_should(mode: str, yaw_sign: int, left_sign: int) -> None:
    # Opposite steering by equal angles turns about a point level with mid wheelbase; the centroid is 30 mm behind it.
    front, rear = (share * 0.4 for share in MODES[mode])
    _, left, yaw_rate = body_velocity(front, rear, 0.3, 0.3, THESIS)
    assert np.sign(np.round(yaw_rate, 12)) == yaw_sign
    assert np.sign(np.round(left, 12)) == left_sign


@pytest.mark.parametrize(("driven", "axle_x"), [("front", 0.181), ("rear", -0.121)])
@pytest.mark.parametrize("turn_rad", [0.4, -0.3])
def test_the_driven_axle_moves_at_the_speed_of_the_drive(driven: Driven, axle_x: float, turn_rad: float) -> None:
    front, rear = turn_rad, -0.5 * turn_rad
    forward, left, yaw_rate = body_velocity(front, rear, 0.3, 0.3, Geometry(0.181, 0.121, driven))
    along, across = velocity_at(axle_x, float(forward), float(left), float(yaw_rate))
    assert math.hypot(along, across) == pytest.approx(0.3)
    assert math.atan2(across, along) == pytest.approx(front if driven == "front" else rear)


@given(front=angle, rear=angle, drive_mps=speed, driven=st.sampled_from(["both", "front", "rear"]))
def test_wheel_speed_inverts_body_velocity(front: float, rear: float, drive_mps: float, driven: Driven) -> None:
    geometry = Geometry(0.181, 0.121, driven)
    forward, _, _ = body_velocity(front, rear, drive_mps, drive_mps, geometry)
    assert float(wheel_speed(forward, front, rear, geometry)) == pytest.approx(drive_mps)


def test_an_unknown_driven_axle_is_refused() -> None:
    with pytest.raises(VehicleError, match=r"driven.*unknown driven axle.*'all'.*both, front, rear"):
        Geometry(0.181, 0.121, "all")  # type: ignore[arg-type]


def test_a_circle_about_a_centre_abeam_of_the_centroid() -> None:
    radius = 1.0
    front, rear = math.atan(0.181 / radius), math.atan(-0.121 / radius)
    forward, left, yaw_rate = body_velocity(front, rear, 0.3, 0.3, THESIS)
    assert float(left) == pytest.approx(0.0, abs=1e-16)
    assert float(forward) / float(yaw_rate) == pytest.approx(radius)


@given(front=angle, rear=angle, drive_mps=speed, lf=length, lr=length)
def test_axle_angles_invert_body_velocity(front: float, rear: float, drive_mps: float, lf: float, lr: float) -> None:
    geometry = Geometry(lf, lr)
    rear_mps = drive_mps * math.cos(front) / math.cos(rear)
    forward, left, yaw_rate = body_velocity(front, rear, drive_mps, rear_mps, geometry)
    again = axle_angles(forward, left, yaw_rate, geometry)
    assert [float(x) for x in again] == pytest.approx([front, rear], abs=1e-9)


@given(front=angle, rear=angle, front_mps=speed, rear_mps=speed)
def test_speed_and_sideslip_are_the_velocity_in_polar_form(
    front: float, rear: float, front_mps: float, rear_mps: float
) -> None:
    v, beta, yaw_rate = body_motion(front, rear, front_mps, rear_mps, THESIS)
    forward, left, yaw_again = body_velocity(front, rear, front_mps, rear_mps, THESIS)
    assert float(v * np.cos(beta)) == pytest.approx(float(forward), abs=1e-12)
    assert float(v * np.sin(beta)) == pytest.approx(float(left), abs=1e-12)
    assert float(yaw_rate) == float(yaw_again)


@given(front=angle, rear=angle, drive_mps=speed)
def test_mirror_image_turns_the_other_way(front: float, rear: float, drive_mps: float) -> None:
    v, beta, yaw_rate = body_motion(front, rear, drive_mps, drive_mps, THESIS)
    assert [float(x) for x in body_motion(-front, -rear, drive_mps, drive_mps, THESIS)] == [v, -beta, -yaw_rate]


def test_arrays_broadcast() -> None:
    outputs = body_motion(np.zeros((3, 1)), np.zeros(4), 0.2, 0.2, THESIS)
    assert [x.shape for x in outputs] == [(3, 4)] * 3


def test_standing_still_determines_no_angle() -> None:
    assert np.all(np.isnan(axle_angles(0.0, 0.0, 0.0, THESIS)))


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf, "wide"])
def test_geometry_refuses_lengths_that_are_none(bad: float) -> None:
    with pytest.raises(VehicleError, match=r"^rear_axle_m: must be"):
        Geometry(0.1, bad)
