"""Pure pursuit and Stanley against geometry that is worked out here, and on vehicles that roll as they are asked."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rolling_vehicle import driven

from agvbench.control import Approach, ControlInput, PurePursuit, Reference, Stanley, sections_of
from agvbench.errors import FlagError, PlanError
from agvbench.model.examples import example_vehicle
from agvbench.planning import load_trajectory, plan, steered, trajectory_from_table
from agvbench.types import Pose

CONTROLLERS = [PurePursuit, Stanley]
NO_COAST = Approach(coast_s=0.0)


def reference(segments, *, vehicle="thesis", steering="abeam", **more):
    table = {"schema": 1, "name": "path", "steering": steering, "segments": segments, "steer_first_s": 0.5, **more}
    return follows(trajectory_from_table(table), vehicle)


def follows(trajectory, vehicle="thesis"):
    model = example_vehicle(vehicle)
    return Reference(plan(steered(trajectory, "", model), model), model)


def straight(length_m=3.0, **more):
    return {"kind": "straight", "length_m": length_m, **more}


def arc(radius_m, angle_deg=90.0, turn="left", **more):
    return {"kind": "arc", "radius_m": radius_m, "angle_deg": angle_deg, "turn": turn, **more}


def asked(controller, reference, pose, t_s=0.6):
    """Return what `controller` asks for at `pose`, after the rest before the start."""
    return controller(ControlInput(t_s, pose, t_s, reference.feed_forward(t_s), reference.planned(t_s)))


@pytest.mark.parametrize("lookahead_m", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("turn", ["left", "right"])
def test_on_a_circle_pure_pursuit_steers_by_the_angle_of_the_circle(turn, lookahead_m):
    on = reference([arc(1.0, 270.0, turn)], steering="front")
    motion = asked(PurePursuit(on, lookahead_m=lookahead_m), on, Pose(0.0, 0.0, 0.0))
    command = on.actuation.command(motion)
    front, rear = (float(angle) for angle in on.model.axle_angles(command.front, command.rear))
    axles = on.model.geometry
    # The rear axle is square to the radius: it lies on a circle through a point rear_axle_m behind the centroid.
    rear_radius_m = math.sqrt(1.0 - axles.rear_axle_m**2)
    side = 1.0 if turn == "left" else -1.0
    assert math.tan(front) == pytest.approx(side * axles.wheelbase_m / rear_radius_m, rel=2e-3)
    assert rear == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-0.2, 0.2), st.floats(-0.4, 0.4), st.floats(0.2, 3.0))
def test_stanley_is_the_law_of_the_paper_at_the_front_axle(left_m, heading, gain):
    on = reference([straight()], steering="front")
    axles = on.model.geometry
    motion = asked(Stanley(on, gain_per_s=gain, softening_mps=0.05), on, Pose(0.5, left_m, heading), t_s=2.0)
    command = on.actuation.command(motion)
    front, rear = (float(angle) for angle in on.model.axle_angles(command.front, command.rear))
    off_m = left_m + axles.front_axle_m * math.sin(heading)
    speed = float(on.model.speed(on.plan.commands.drive[1]))
    steering = -heading - math.atan2(gain * off_m, 0.05 + speed)
    limits = on.model.front.output_range
    assert front == pytest.approx(float(np.clip(steering, *limits)), abs=1e-6)
    assert rear == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("controller", CONTROLLERS)
@given(
    left_m=st.floats(-0.1, 0.1),
    heading=st.floats(-0.3, 0.3),
    direction=st.sampled_from(["forward", "backward"]),
    vehicle=st.sampled_from([("thesis", "abeam"), ("thesis", "front"), ("thesis", "rear"), ("differential", "abeam")]),
)
@settings(max_examples=25)
def test_a_vehicle_that_starts_beside_a_straight_comes_to_it(controller, left_m, heading, direction, vehicle):
    name, steering = vehicle
    on = reference([straight(direction=direction)], vehicle=name, steering=steering)
    poses, _ = driven(controller(on, approach=NO_COAST), on, (0.0, left_m, heading))
    assert abs(poses[-1].y_m) < 0.01
    assert abs(poses[-1].heading_rad) < 0.05
    assert abs(abs(poses[-1].x_m) - 3.0) < 0.05


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("name", ["1", "2", "5", "8", "s_curve", "slalom", "garage", "u_turn", "parallel_park"])
def test_the_end_of_a_trajectory_is_where_it_leads(controller, name):
    on = follows(load_trajectory(name))
    poses, motions = driven(controller(on, approach=NO_COAST), on)
    error = poses[-1].relative_to(on.plan.target)
    assert math.hypot(error.x_m, error.y_m) < 0.04
    assert abs(error.heading_rad) < math.radians(10.0)
    gears = [np.sign(m.speed_mps) for m in motions if m.speed_mps]
    planned = [np.sign(on.feed_forward(t).speed_mps) for t in on.plan.commands.t_s if on.feed_forward(t).speed_mps]
    assert changes(gears) == changes(planned)


def changes(gears):
    return [gear for i, gear in enumerate(gears) if not i or gear != gears[i - 1]]


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_path_that_crosses_itself_is_driven_to_its_end(controller):
    on = follows(load_trajectory("figure_eight"))
    poses, _ = driven(controller(on, approach=NO_COAST), on)
    places = np.array(poses)[:, :2]
    assert np.hypot(*np.diff(places, axis=0).T).sum() == pytest.approx(2 * 2 * math.pi * 0.7, rel=0.03)
    assert places[:, 1].max() > 1.3
    assert places[:, 1].min() < -1.3


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_pause_of_the_plan_is_kept(controller):
    on = reference([straight(0.5), {"kind": "pause", "duration_s": 2.0}, straight(0.5)])
    _, motions = driven(controller(on), on)
    rests = [motion.speed_mps == 0.0 for motion in motions]
    assert rests[:5] == [True] * 5
    assert sum(rests[5:]) == 20


def test_progress_is_searched_near_the_last_one():
    (section,) = sections_of(follows(load_trajectory("figure_eight")))
    at_the_crossing = Pose(0.0, 0.0, 0.0)
    circle_m = 2 * math.pi * 0.7
    assert section.length_m == pytest.approx(2 * circle_m, rel=1e-3)
    for near_m in (0.0, circle_m, 2 * circle_m):
        assert section.progress(at_the_crossing, near_m, 0.2) == pytest.approx(near_m, abs=0.01)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize(
    ("segments", "vehicle", "what"),
    [
        ([straight(steering="crab", crab_deg=25.0)], "thesis", "a path across the heading cannot be followed"),
        ([straight(), {"kind": "spot_turn", "turn": "left", "angle_deg": 90.0, "yaw_rate": "full"}], "differential",
         "a turn on the spot cannot be followed"),
    ],
)  # fmt: skip
def test_what_no_curvature_follows_is_refused_before_anything_moves(controller, segments, vehicle, what):
    on = reference(segments, vehicle=vehicle)
    with pytest.raises(PlanError, match=f"path: {what}; drive it open loop, or with a controller that returns"):
        controller(on)


@pytest.mark.parametrize(
    "make",
    [
        partial(PurePursuit, lookahead_m=0.0),
        partial(PurePursuit, lookahead_m=math.nan),
        partial(Stanley, gain_per_s=-1.0),
        partial(Stanley, softening_mps=-0.1),
        partial(Stanley, lever_m=0.0),
        lambda _: Approach(slow_m=-1.0),
        lambda _: Approach(coast_s=math.inf),
        lambda _: Approach(least_share=0.0),
    ],
)
def test_parameters_out_of_range_are_refused(make):
    with pytest.raises(FlagError, match=r"of the controller: value cannot be used: .* \(limit: "):
        make(reference([straight()]))
