"""Axle angles from arcs that a rigid body drives about the point where its wheels' normals meet."""

from __future__ import annotations

import numpy as np
import pytest
from calibration_samples import FRONT_M, REAR_M, steady_poses, turning_point
from hypothesis import given
from hypothesis import strategies as st

from agvbench.calibration import axle_angles_from_arc, axle_angles_from_curvature, fit_circle
from agvbench.vehicle.geometry import Geometry

GEOMETRY = Geometry(FRONT_M, REAR_M)
ANGLES = st.floats(-0.75, 0.75)

# The five cases of thesis fig. 6.4 by where the centre projects, to the left and to the right.
CASES = {
    "1: on the front axle": (0.0, -0.4),
    "2: on the rear axle": (0.4, 0.0),
    "3: between the axles": (0.4, -0.3),
    "4: ahead of the front axle": (-0.1, -0.5),
    "5: behind the rear axle": (0.5, 0.1),
}


def floor_centre(front, rear, pose):
    along, left = turning_point(front, rear)
    x, y, heading = pose
    c, s = np.cos(heading), np.sin(heading)
    return x + c * along - s * left, y + s * along + c * left


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_the_five_cases_on_both_sides_forward_and_backward(case, side, speed):
    front, rear = (side * angle for angle in CASES[case])
    poses = steady_poses(front, rear, speed, np.arange(0, 4, 1 / 120))
    fit = fit_circle(poses[:, :2])
    found = axle_angles_from_arc(fit.center, *poses.T, GEOMETRY)
    assert np.allclose(found[0], front, atol=1e-9)
    assert np.allclose(found[1], rear, atol=1e-9)


def test_the_cases_are_where_the_thesis_says():
    ahead = {name: turning_point(*angles)[0] for name, angles in CASES.items()}
    assert ahead["1: on the front axle"] == pytest.approx(FRONT_M)
    assert ahead["2: on the rear axle"] == pytest.approx(-REAR_M)
    assert -REAR_M < ahead["3: between the axles"] < FRONT_M
    assert ahead["4: ahead of the front axle"] > FRONT_M
    assert ahead["5: behind the rear axle"] < -REAR_M


@given(ANGLES, ANGLES, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1))
def test_angles_are_found_from_any_centre_and_pose(front, rear, x, y, heading):
    if abs(front - rear) < 1e-3:
        return
    found = axle_angles_from_arc(floor_centre(front, rear, (x, y, heading)), x, y, heading, GEOMETRY)
    assert np.allclose(found, (front, rear), atol=1e-7)


@given(ANGLES, ANGLES, st.sampled_from([0.4, -0.4]))
def test_curvature_and_sideslip_say_the_same_straight_motion_included(front, rear, speed):
    # On a steady circle the chord points along the heading half way, whatever its length.
    before, after = steady_poses(front, rear, speed, [0.0, 0.1])
    way = 0.1 * speed
    curvature = (after[2] - before[2]) / way
    direction = np.arctan2(after[1] - before[1], after[0] - before[0]) + (np.pi if way < 0 else 0)
    sideslip = (direction - 0.5 * (before[2] + after[2]) + np.pi) % (2 * np.pi) - np.pi
    assert np.allclose(axle_angles_from_curvature(curvature, sideslip, GEOMETRY), (front, rear), atol=1e-6)


def test_a_centre_on_the_centre_line_determines_nothing():
    assert np.isnan(axle_angles_from_arc((1.0, 0.0), 0.0, 0.0, 0.0, GEOMETRY)).all()
