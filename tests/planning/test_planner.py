"""Commands, time and target of plans, against an independent integration of the vehicle."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planning_truth import FRONT_M, REAR_M, driven, end_of

from agvbench.errors import PlanError
from agvbench.model import nominal_model, thesis_vehicle
from agvbench.planning import Workspace, load_trajectory, plan, trajectory_from_table
from agvbench.planning.shortest_paths.pieces import Piece
from agvbench.types import Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Line, MonotoneTable

NOMINAL = nominal_model("agv", Geometry(FRONT_M, REAR_M), Channels.alike("us"))
THESIS = thesis_vehicle()
FULL_MPS = float(THESIS.speed(900.0))
turns = st.sampled_from(["left", "right"])
directions = st.sampled_from(["forward", "backward"])
arcs = st.fixed_dictionaries(
    {
        "kind": st.just("arc"),
        "turn": turns,
        "radius_m": st.floats(0.3, 3.0),
        "angle_deg": st.floats(5.0, 200.0),
        "direction": directions,
    }
)
straights = st.fixed_dictionaries(
    {"kind": st.just("straight"), "length_m": st.floats(0.05, 3.0), "direction": directions}
)
some_segments = st.lists(arcs | straights, min_size=1, max_size=4)
quick = settings(deadline=None, max_examples=30)


def from_segments(segments, **keys):
    return trajectory_from_table({"schema": 1, "name": "t", "segments": segments, **keys})


def pieces_of(segments):
    for s in segments:
        if s["kind"] == "arc":
            length = math.radians(s["angle_deg"]) * s["radius_m"]
            yield Piece(s["turn"], length, s["radius_m"], backward=s["direction"] == "backward")
        else:
            yield Piece("straight", s["length_m"], backward=s["direction"] == "backward")


@quick
@given(segments=some_segments)
def test_planned_commands_drive_an_independent_vehicle_to_the_target(segments):
    made = plan(from_segments(segments), NOMINAL)
    x, y, heading = driven(made.commands, made.duration_s)
    end = Pose(x, y, heading).relative_to(made.target)
    assert np.allclose(end, 0.0, atol=1e-6)


@quick
@given(segments=some_segments)
def test_steered_abeam_the_target_is_where_the_path_leads(segments):
    target = end_of(pieces_of(segments), Pose(0.0, 0.0, 0.0))
    for model in (NOMINAL, THESIS):
        made = plan(from_segments(segments), model)
        assert np.allclose(made.target.relative_to(target), 0.0, atol=1e-9)
        assert np.allclose(Pose(*made.expected[-1, 1:]).relative_to(target), 0.0, atol=1e-9)


@quick
@given(segments=some_segments)
def test_expected_path_is_where_the_independent_vehicle_is_at_that_time(segments):
    made = plan(from_segments(segments), NOMINAL)
    for t, x, y, heading in made.expected[:: len(made.expected) // 5 + 1]:
        rows = np.flatnonzero(made.commands.t_s <= t)
        until = type(made.commands)(*(column[rows] for column in vars(made.commands).values()))
        assert np.allclose(driven(until, t), [x, y, heading], atol=1e-6)


@quick
@given(segments=some_segments)
def test_commands_are_a_table_that_can_be_driven(segments):
    commands = plan(from_segments(segments), THESIS).commands
    assert commands.t_s[0] == 0.0
    assert np.all(np.diff(commands.t_s) > 0.0)
    assert commands.drive[0] == commands.drive[-1] == 1500.0
    assert np.all(np.isfinite([commands.drive, commands.front, commands.rear]))


@quick
@given(segments=some_segments)
def test_gear_is_never_changed_without_a_stop(segments):
    commands = plan(from_segments(segments), NOMINAL).commands
    away = commands.drive - 1500.0
    assert np.all(away[1:] * away[:-1] >= 0.0)


@pytest.mark.parametrize("mode", ["abeam", "front", "rear", "opposite"])
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_every_mode_turns_through_the_same_angle_and_chord(mode, turn, direction):
    arc = {"kind": "arc", "turn": turn, "radius_m": 1.0, "angle_deg": 90.0, "direction": direction}
    made = plan(from_segments([arc], steering=mode), NOMINAL)
    x, y, heading = driven(made.commands, made.duration_s)
    assert math.hypot(x, y) == pytest.approx(math.sqrt(2.0), abs=1e-6)
    assert abs(heading) == pytest.approx(math.pi / 2.0, abs=1e-6)
    assert np.allclose([x, y, heading], made.target, atol=1e-6)
    assert (x > 0.0) == (direction == "forward")
    assert (y > 0.0) == (turn == "left")


def test_modes_steer_the_axles_they_are_named_after():
    arc = {"kind": "arc", "turn": "left", "radius_m": 1.0, "angle_deg": 90.0}
    commands = {
        mode: plan(from_segments([arc], steering=mode), NOMINAL).commands.at(0)
        for mode in ("abeam", "front", "rear", "opposite")
    }
    assert commands["front"].rear == 1500.0
    assert commands["front"].front < 1500.0
    assert commands["rear"].front == 1500.0
    assert commands["rear"].rear > 1500.0
    assert 1500.0 - commands["opposite"].front == pytest.approx(commands["opposite"].rear - 1500.0)
    degrees = [(1500.0 - pulse) * 45.0 / 600.0 for pulse in commands["abeam"][1:]]
    assert np.allclose(degrees, np.degrees([math.atan(FRONT_M), -math.atan(REAR_M)]))


def test_crab_moves_sideways_and_keeps_its_heading():
    made = plan(from_segments([{"kind": "straight", "length_m": 1.0, "crab_deg": 30.0}], steering="crab"), NOMINAL)
    expected = [math.cos(math.pi / 6), math.sin(math.pi / 6), 0.0]
    assert np.allclose(driven(made.commands, made.duration_s), expected, atol=1e-6)
    assert np.allclose(made.target, expected)


@pytest.mark.parametrize("mode", ["abeam", "front", "rear", "opposite"])
def test_an_arc_may_be_given_by_its_axle_angle(mode):
    arc = {"kind": "arc", "turn": "left", "axle_angle_deg": 20.0, "length_m": 1.0}
    command = plan(from_segments([arc], steering=mode), NOMINAL).commands.at(0)
    steered = command.rear if mode == "rear" else command.front
    assert abs(1500.0 - steered) * 45.0 / 600.0 == pytest.approx(20.0)


def test_time_accounts_for_the_centroid_being_slower_than_the_axles():
    made = plan(load_trajectory("5"), NOMINAL)
    mean_cosine = 0.5 * (math.cos(math.atan(FRONT_M)) + math.cos(math.atan(REAR_M)))
    assert made.duration_s == pytest.approx(0.5 + 0.5 * math.pi / (0.32 * mean_cosine))


def test_steering_is_set_before_the_drive_starts_and_held_while_it_stops():
    commands = plan(load_trajectory("5"), NOMINAL).commands
    assert commands.t_s[:2].tolist() == [0.0, 0.5]
    assert commands.drive.tolist() == [1500.0, 900.0, 1500.0]
    assert len(set(commands.front.tolist())) == len(set(commands.rear.tolist())) == 1


def test_steering_first_can_be_switched_off(make):
    made = plan(make(steer_first_s=0.0, s_curve={"turn": "left", "radius_m": 1.0, "angle_deg": 30.0}), NOMINAL)
    assert made.commands.drive.tolist() == [900.0, 900.0, 1500.0]


def test_steering_at_rest_stops_at_every_change(make):
    curve = {"turn": "left", "radius_m": 1.0, "angle_deg": 30.0}
    made = plan(make(steer_at_rest=True, s_curve=curve), NOMINAL)
    assert made.commands.drive.tolist() == [1500.0, 900.0, 1500.0, 900.0, 1500.0]
    assert np.allclose(driven(made.commands, made.duration_s), made.target, atol=1e-6)


def test_a_pause_stands_still_with_the_steering_as_it_was(make):
    arc = {"kind": "arc", "turn": "left", "radius_m": 1.0, "angle_deg": 30.0}
    made = plan(make(segments=[arc, {"kind": "pause", "duration_s": 2.0}, arc]), NOMINAL)
    assert made.commands.drive.tolist() == [1500.0, 900.0, 1500.0, 900.0, 1500.0]
    assert made.commands.t_s[3] - made.commands.t_s[2] == pytest.approx(2.0)
    assert len(set(made.commands.front.tolist())) == 1


@pytest.mark.parametrize(
    ("speed", "mps"), [("full", FULL_MPS), ("half", 0.5 * FULL_MPS), ("25%", 0.25 * FULL_MPS), (0.2, 0.2)]
)
def test_speed_is_that_of_the_calibrated_axles(make, speed, mps):
    made = plan(make(speed=speed, segments=[{"kind": "straight", "length_m": 1.0}]), THESIS)
    assert made.duration_s - 0.5 == pytest.approx(1.0 / mps)
    assert float(THESIS.speed(made.commands.drive[1])) == pytest.approx(mps)


def test_a_segment_may_have_its_own_speed_and_steering(make):
    straight = {"kind": "straight", "length_m": 0.5, "speed": 0.1, "steering": "crab", "crab_deg": 10.0}
    arc = {"kind": "arc", "turn": "left", "radius_m": 1.0, "angle_deg": 20.0}
    made = plan(make(segments=[straight, arc]), THESIS)
    assert np.allclose(THESIS.speed(made.commands.drive[1:3]), [0.1, FULL_MPS])
    assert np.allclose(made.commands.t_s[2] - made.commands.t_s[1], 0.5 / (0.1 * math.cos(0.0)), rtol=1e-6)


def test_raw_commands_are_driven_as_they_stand(make):
    rows = [[0.0, 1500.0, 1400.0, 1500.0], [0.5, 1300.0, 1400.0, 1600.0]]
    made = plan(make(commands={"unit": "us", "duration_s": 4.0, "rows": rows}), NOMINAL)
    table = np.column_stack(list(vars(made.commands).values()))
    assert table.tolist() == [*rows, [4.0, 1500.0, 1400.0, 1600.0]]
    assert not made.target.is_finite
    assert np.allclose(made.expected[-1, 1:], driven(made.commands, 4.0), atol=1e-6)


def test_a_stated_target_is_kept_and_none_is_none(make):
    keys = {"segments": [{"kind": "straight", "length_m": 1.0}]}
    stated = make(target={"x_m": 1.0, "y_m": 0.2, "heading_deg": 90.0}, **keys)
    assert plan(stated, NOMINAL).target == Pose(1.0, 0.2, math.pi / 2)
    assert not plan(make(target="none", **keys), NOMINAL).target.is_finite


@pytest.mark.parametrize("name", ["1", "5", "8"])
def test_an_axle_that_is_mounted_a_little_off_turns_the_other_with_it(front_steered, name):
    trajectory = load_trajectory(name).with_steering("front")
    straight_ahead = plan(trajectory, front_steered)
    off = dataclasses.replace(front_steered, rear=dataclasses.replace(front_steered.rear, output=math.radians(0.7)))
    made = plan(trajectory, off)
    turned = [math.degrees(float(np.ptp(p.expected[:, 3]))) for p in (straight_ahead, made)]
    assert turned[1] == pytest.approx(turned[0], abs=0.5)
    assert made.duration_s == pytest.approx(straight_ahead.duration_s, rel=0.01)


def test_an_axle_that_is_mounted_far_off_is_told(front_steered):
    off = dataclasses.replace(front_steered, rear=dataclasses.replace(front_steered.rear, output=math.radians(7.0)))
    with pytest.raises(PlanError, match="which does not steer"):
        plan(load_trajectory("1"), off)


def test_a_vehicle_steered_in_front_needs_the_front_mode(front_steered):
    with pytest.raises(PlanError, match='rear axle, which does not steer; say steering = "front"'):
        plan(load_trajectory("5"), front_steered)
    made = plan(load_trajectory("5").with_steering("front"), front_steered)
    assert np.all(made.commands.rear == front_steered.neutral.rear)


@quick
@given(radius_m=st.floats(0.1, 0.5), mode=st.sampled_from(["abeam", "front", "rear", "opposite"]), turn=turns)
def test_advice_on_a_turn_that_is_too_tight_can_be_followed(radius_m, mode, turn):
    arc = {"kind": "arc", "turn": turn, "angle_deg": 45.0}
    try:
        plan(from_segments([arc | {"radius_m": radius_m}], steering=mode), THESIS)
    except PlanError as error:
        if error.remedy and error.remedy.startswith("widen it to at least"):
            advised = float(error.remedy.split()[-2])
            assert advised > radius_m
            plan(from_segments([arc | {"radius_m": advised}], steering=mode), THESIS)


def test_half_speed_is_refused_before_calibration():
    with pytest.raises(PlanError, match=r"3: segments\[0\]: speed 0.160 m/s cannot be commanded"):
        plan(load_trajectory("3"), NOMINAL)


def test_a_drive_without_known_full_speed_needs_metres_per_second(make):
    endless = type(NOMINAL)(
        "agv", NOMINAL.geometry, Channels.alike("us"), NOMINAL.front, NOMINAL.rear, Line(-5e-4, 0.75)
    )
    segments = [{"kind": "straight", "length_m": 1.0}]
    with pytest.raises(PlanError, match="say it in m/s"):
        plan(make(segments=segments), endless)
    assert plan(make(speed=0.2, segments=segments), endless).duration_s == pytest.approx(5.5)


def test_floor_covers_both_axles():
    width, height = plan(load_trajectory("1"), NOMINAL).floor_m
    assert width == pytest.approx(2.0 + FRONT_M + REAR_M)
    assert height == pytest.approx(0.0)


def test_a_plan_says_where_to_start(make):
    workspace = Workspace.rectangle(3.0, 1.0, margin_m=0.2)
    made = plan(load_trajectory("1"), NOMINAL, workspace=workspace)
    assert made.start.heading_rad == 0.0
    assert made.start.x_m == pytest.approx(-1.0 - 0.5 * (FRONT_M - REAR_M), abs=0.02)
    assert plan(load_trajectory("1"), NOMINAL).start == Pose(0.0, 0.0, 0.0)
    given_start = Pose(-1.0, 0.1, 0.0)
    assert plan(load_trajectory("1"), NOMINAL, workspace=workspace, start=given_start).start == given_start


def test_a_start_from_which_the_path_leaves_the_floor_is_refused():
    with pytest.raises(PlanError, match=r"path leaves the workspace circle:6\.1 after"):
        plan(load_trajectory("1"), NOMINAL, workspace=Workspace.circle(), start=Pose(1.5, 0.0, 0.0))


@pytest.mark.parametrize("shape", ["u_turn", "dock_backward", "parallel_park"])
def test_shortest_paths_end_at_their_goal(shape):
    trajectory = load_trajectory(shape)
    made = plan(trajectory, NOMINAL)
    goal = trajectory.dubins.goal.pose
    assert np.allclose(Pose(*driven(made.commands, made.duration_s)).relative_to(goal), 0.0, atol=1e-6)


def test_a_path_between_poses_is_seen_from_its_start(make):
    start = {"x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0}
    via = {"x_m": 1.0, "y_m": 4.0, "heading_deg": 90.0}
    goal = {"x_m": 0.0, "y_m": 5.0, "heading_deg": 180.0}
    made = plan(make(dubins={"start": start, "via": [via], "goal": goal, "radius_m": 1.0}), NOMINAL)
    assert np.allclose(made.target, [3.0, 1.0, math.pi / 2], atol=1e-9)


@pytest.mark.parametrize(("arcs", "first"), list(itertools.product([2, 3, 6], ["left", "right"])))
def test_a_slalom_comes_back_to_its_line(make, arcs, first):
    shape = {"turn": first, "radius_m": 1.0, "angle_deg": 20.0, "arcs": arcs}
    end = plan(make(slalom=shape), NOMINAL).expected[-1]
    chord = 2.0 * math.sin(math.radians(20.0))
    drop = 2.0 * (1.0 - math.cos(math.radians(20.0))) * (1 if first == "left" else -1)
    assert end[3] == pytest.approx(0.0, abs=1e-9)
    assert end[1] == pytest.approx(chord * (arcs - 1), abs=1e-9)
    assert end[2] == pytest.approx(drop if arcs % 2 == 0 else 0.0, abs=1e-9)


def test_floor_of_circles_does_not_depend_on_how_often_they_are_driven(make):
    short, long = (
        plan(make(endurance={"turn": "left", "radius_m": 1.0, "duration_s": hours * 3600.0}), NOMINAL)
        for hours in (0.1, 50.0)
    )
    assert short.floor_m == long.floor_m
    outer = math.hypot(1.0, FRONT_M)
    assert long.floor_m == pytest.approx((2.0 * outer, 2.0 * outer), abs=1e-3)
    assert len(long.expected) <= 20_002
    assert len(long.swept) == len(short.swept)


@quick
@given(segments=some_segments)
def test_swept_floor_holds_the_axles_of_the_expected_path(segments):
    made = plan(from_segments(segments), NOMINAL)
    _, x, y, heading = made.expected.T
    for ahead in (FRONT_M, -REAR_M):
        for path, swept in (
            (x + ahead * np.cos(heading), made.swept[:, 1]),
            (y + ahead * np.sin(heading), made.swept[:, 2]),
        ):
            assert swept.min() - 1e-3 <= path.min()
            assert path.max() <= swept.max() + 1e-3


def test_after_a_pause_other_steering_is_set_before_the_drive_starts(make):
    left, right = ({"kind": "arc", "turn": turn, "radius_m": 1.0, "angle_deg": 30.0} for turn in ("left", "right"))
    commands = plan(make(segments=[left, {"kind": "pause", "duration_s": 2.0}, right]), NOMINAL).commands
    # Rest, left, pause, steering to the right at rest, right, stop.
    assert commands.drive.tolist() == [1500.0, 900.0, 1500.0, 1500.0, 900.0, 1500.0]
    assert np.allclose(np.diff(commands.t_s)[[0, 2, 3]], [0.5, 2.0, 0.5])
    assert commands.front[2] < 1500.0 < commands.front[3] == commands.front[4]


def test_a_vehicle_that_no_command_but_neutral_stops_rests_at_neutral(make):
    """Its calibration had no command between neutral and the slowest speed."""
    creeping = dataclasses.replace(THESIS, drive=MonotoneTable((900.0, 1400.0), (0.3, 0.06), "linear"))
    made = plan(make(speed=0.2, segments=[{"kind": "straight", "length_m": 1.0}]), creeping)
    assert made.commands.drive[0] == made.commands.drive[-1] == 1500.0
    assert made.target.x_m == pytest.approx(1.0)


@pytest.mark.parametrize("full_mps", np.linspace(0.29, 0.36, 15))
def test_half_a_turn_is_positive_whatever_its_rounding(full_mps):
    drive = Line.through(1500.0, -float(full_mps) / 600.0, command_low=900.0, command_high=2100.0)
    vehicle = dataclasses.replace(THESIS, drive=drive)
    assert plan(load_trajectory("u_turn"), vehicle).target.heading_rad > 3.0
