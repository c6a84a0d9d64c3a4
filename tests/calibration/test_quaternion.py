"""Headings against scipy's rotation matrices, and the thesis' own formulas where they hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from agvbench.calibration import quaternion_to_heading
from agvbench.errors import InputError

QUATERNIONS = arrays(np.float64, 4, elements=st.floats(-1, 1, allow_subnormal=False))


def wrapped_difference(a, b):
    return (np.asarray(a) - b + np.pi) % (2 * np.pi) - np.pi


@given(QUATERNIONS, st.sampled_from(["y", "z"]))
def test_heading_is_the_floor_direction_of_the_rotated_x_axis(q, up):
    assume(np.linalg.norm(q) > 1e-3)
    axis = Rotation.from_quat(q).apply([1.0, 0.0, 0.0])
    floor = (axis[0], -axis[2]) if up == "y" else (axis[0], axis[1])
    assume(np.hypot(*floor) > 1e-4)
    heading = quaternion_to_heading(*q, up=up)
    assert abs(wrapped_difference(heading, np.arctan2(floor[1], floor[0]))) < 1e-9


@given(st.floats(-np.pi, np.pi), st.sampled_from(["y", "z"]), st.sampled_from([1, -1]))
def test_poles_keep_the_heading_from_before_the_body_pitched(heading, up, sign):
    yaw, pitch = ("y", "z") if up == "y" else ("z", "y")
    # About z a positive angle lifts the x axis; about y it lowers it.
    angle = sign * np.pi / 2 * (1 if up == "y" else -1)
    q = (Rotation.from_euler(yaw, heading) * Rotation.from_euler(pitch, angle)).as_quat()
    assert abs(wrapped_difference(quaternion_to_heading(*q, up=up), heading)) < 1e-7


@given(st.floats(-np.pi, np.pi), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_thesis_equation_6_1_holds_away_from_the_poles(heading, roll, pitch):
    qx, qy, qz, qw = Rotation.from_euler("YZX", [heading, pitch, roll]).as_quat()
    published = np.arctan2(2 * qy * qw - 2 * qx * qz, 1 - 2 * qy**2 - 2 * qz**2)
    assert abs(wrapped_difference(quaternion_to_heading(qx, qy, qz, qw), published)) < 1e-12
    assert abs(wrapped_difference(published, heading)) < 1e-9


def test_just_before_the_pole_roll_is_not_heading():
    # 2.6° from the pole, where the thesis already switches to eq. 6.3 and takes roll for heading.
    q = Rotation.from_euler("YZX", [0.5, np.radians(87.4), 0.4])
    qx, qy, qz, qw = q.as_quat()
    assert qx * qy + qz * qw > 0.499
    assert abs(wrapped_difference(quaternion_to_heading(qx, qy, qz, qw), 0.5)) < 1e-9
    assert abs(wrapped_difference(2 * np.arctan2(qx, qw), 0.5)) > 0.3


def test_vectorised_over_single_precision_and_sign():
    headings = np.linspace(-3.1, 3.1, 101)
    q = Rotation.from_euler("y", headings[:, None]).as_quat().astype(np.float32)
    assert np.allclose(quaternion_to_heading(*q.T), headings, atol=1e-6)
    assert np.allclose(quaternion_to_heading(*-q.T), headings, atol=1e-6)
    assert np.allclose(quaternion_to_heading(*(3.0 * q).T), headings, atol=1e-6)


def test_untracked_bodies_have_no_heading():
    assert np.isnan(quaternion_to_heading([0.0, np.nan], 0.0, 0.0, [0.0, 1.0])).all()


def test_unknown_vertical_axis_is_one_clear_line():
    with pytest.raises(InputError, match=r"unknown vertical axis: 'x' \(one of: y, z\)"):
        quaternion_to_heading(0, 0, 0, 1, up="x")  # type: ignore[arg-type]
