"""Workspaces, and where a path is placed in them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agvbench.errors import InputError, PlanError
from agvbench.planning import Workspace, place, plan, trajectory_from_table
from agvbench.planning.placement import best_start
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.types import Pose
from agvbench.vehicle.maps import FullSpeedOrStop

SQUARE = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
points_in_a_box = st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=2, max_size=12, unique=True
).map(np.array)


def straight(length_m):
    segments = [{"kind": "straight", "length_m": length_m}]
    return trajectory_from_table({"schema": 1, "name": "straight", "segments": segments})


@pytest.mark.parametrize(
    ("text", "inside", "outside"),
    [
        ("circle:6.1", [(0.0, 3.04), (2.1, 2.1)], [(0.0, 3.06), (2.3, 2.3)]),
        ("ellipse:6x2", [(2.9, 0.0), (0.0, 0.9)], [(0.0, 1.1), (2.0, 0.9)]),
        ("rectangle:4x3", [(1.9, 1.4)], [(2.1, 0.0), (0.0, 1.6)]),
        ("polygon:0,0 4,0 4,4 0,4", [(0.1, 0.1), (3.9, 2.0)], [(-0.1, 2.0), (2.0, 4.1)]),
        ("polygon:0,4 4,4 4,0 0,0", [(0.1, 0.1)], [(-0.1, 2.0)]),
    ],
)
def test_clearance_is_positive_inside_and_negative_outside(text, inside, outside):
    workspace = Workspace.parse(text)
    assert np.all(workspace.clearances(np.array(inside)) > 0.0)
    assert np.all(workspace.clearances(np.array(outside)) < 0.0)


@given(angle=st.floats(0.0, 2.0 * math.pi), radius_m=st.floats(0.0, 3.0))
def test_clearance_in_a_circle_is_the_distance_to_it(angle, radius_m):
    point = radius_m * np.array([[math.cos(angle), math.sin(angle)]])
    assert Workspace.circle(6.0).clearances(point)[0] == pytest.approx(3.0 - radius_m, abs=2e-4)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hall",
        "circle",
        "circle:big",
        "rectangle:4",
        "rectangle:4x3x2",
        "polygon:0,0 1,1",
        "polygon:0 1 2",
        "circle:-2",
        "circle:nan",
        "ellipse:4xinf",
        "polygon:0,0 2,2 2,0 0,2",
        "polygon:0,0 4,0 4,4 2,1 0,4",
    ],
)
def test_a_workspace_that_is_none_is_refused_in_one_line(text):
    with pytest.raises(InputError) as error:
        Workspace.parse(text)
    assert "\n" not in str(error.value)


@settings(deadline=None, max_examples=40)
@given(points=points_in_a_box, size=st.tuples(st.floats(2.0, 8.0), st.floats(2.0, 8.0)))
def test_no_other_start_leaves_noticeably_more_room(points, size):
    workspace = Workspace.rectangle(*size)
    start, distance = best_start(points, workspace)

    def room(x, y, heading):
        c, s = math.cos(heading), math.sin(heading)
        return workspace.clearances(points @ np.array([[c, s], [-s, c]]) + [x, y]).min()

    assert distance - 0.011 <= room(*start) <= distance + 1e-6
    rng = np.random.default_rng(7)
    for x, y in rng.uniform(-1.0, 1.0, (50, 2)):
        assert room(x, y, start.heading_rad) <= distance + 1e-6


def test_a_straight_lies_along_the_longer_side(nominal):
    assert plan(straight(3.0), nominal, workspace=Workspace.rectangle(4.5, 1.0)).start.heading_rad == 0.0
    upright = plan(straight(3.0), nominal, workspace=Workspace.rectangle(1.0, 4.5)).start
    assert upright.heading_rad == pytest.approx(math.pi / 2.0)
    assert upright.x_m == pytest.approx(0.0, abs=1e-6)


def test_a_straight_lies_askew_only_where_it_has_to(nominal):
    square = Workspace.rectangle(3.0, 3.0)
    assert plan(straight(2.0), nominal, workspace=square).start.heading_rad == 0.0
    assert math.degrees(plan(straight(2.6), nominal, workspace=square).start.heading_rad) % 90.0 == pytest.approx(45.0)


def test_placing_follows_a_workspace_that_is_off_the_origin(nominal):
    start = plan(straight(1.0), nominal, workspace=Workspace.polygon(SQUARE)).start
    assert (start.x_m + 0.5, start.y_m) == pytest.approx((2.0, 2.0), abs=0.05)


@given(slack=st.floats(-0.5, 0.5).filter(lambda slack: abs(slack) > 0.001))
@settings(deadline=None, max_examples=20)
def test_a_path_fits_or_not_to_the_millimetre(slack):
    from agvbench.model import thesis_vehicle

    vehicle = thesis_vehicle()
    # The axles sweep 2 m and their own distance; in a circle there is a margin at both ends.
    diameter = 2.0 + vehicle.geometry.wheelbase_m + 2.0 * 0.25 + slack
    made = plan(straight(2.0), vehicle)
    if slack > 0.0:
        place(made, Workspace.circle(diameter))
    else:
        with pytest.raises(PlanError, match="does not fit"):
            place(made, Workspace.circle(diameter))


def test_a_start_where_it_was_placed_is_accepted(nominal):
    workspace = Workspace.parse("polygon:0,0 3.1,0 4,2 0,3.1")
    placed = plan(straight(1.5), nominal, workspace=workspace)
    again = plan(straight(1.5), nominal, workspace=workspace, start=placed.start)
    assert again.start == placed.start


def test_leaving_the_workspace_is_told_with_time_and_place(nominal):
    with pytest.raises(PlanError) as error:
        plan(straight(2.0), nominal, workspace=Workspace.rectangle(4.0, 4.0), start=Pose(0.0, 0.0, math.pi / 2.0))
    # The front axle is 0.181 m ahead and may come within 0.25 m of the edge at 2 m.
    t = 0.5 + (2.0 - 0.25 - 0.181) / 0.32
    assert f"after {t:.1f} s at (0.00, 1.7" in str(error.value)


@pytest.mark.parametrize("speed_mps", [0.3, 1.0, 1.5])
def test_a_vehicle_that_is_stopped_anywhere_comes_to_rest_inside(speed_mps):
    drive = FullSpeedOrStop(900.0, 1500.0, 2100.0, output_low=speed_mps, output_high=-speed_mps)
    workspace = Workspace.circle(5.0)
    made = plan(straight(3.4), replace(uncalibrated_vehicle(), drive=drive), workspace=workspace)
    x_m, y_m = (made.start.place(made.expected[:, 1:3])).T
    velocity = np.column_stack([np.gradient(x_m, made.expected[:, 0]), np.gradient(y_m, made.expected[:, 0])])
    rest = np.column_stack([x_m, y_m]) + 0.6 * velocity
    assert workspace.clearances(rest).min() > -1e-3
    with pytest.raises(PlanError):
        plan(straight(5.0 - 0.6 * speed_mps), replace(uncalibrated_vehicle(), drive=drive), workspace=workspace)
