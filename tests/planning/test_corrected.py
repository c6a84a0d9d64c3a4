"""Corrected plans, driven by plants of the simulator, whose equations are its own: the truth is not the planner's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from agvbench.effects import SteeringLag, effect_kinds
from agvbench.effects.axles.wheelbase_error import WheelbaseError
from agvbench.effects.camera.mocap_scale import MocapScale
from agvbench.effects.electronics.battery_droop import BatteryDroop
from agvbench.effects.ground.floor_tilt import FloorTilt
from agvbench.errors import PlanError
from agvbench.model import VehicleModel
from agvbench.planning import (
    Departure,
    Workspace,
    corrected_plan,
    depends_on_time,
    load_trajectory,
    plan,
    trajectory_from_table,
)
from agvbench.simulator.hidden import make_hidden_plant
from agvbench.simulator.hidden.plant import HiddenPlant
from agvbench.types import Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import Fixed, Line, MonotoneTable

REST_S = 4.0
START = Pose(-0.4, 0.3, 0.7)
EIGHT = [str(k) for k in range(1, 9)]
# Every stage of the chain; one that none of the eight trajectories shows (a delay, a latency) would show nothing here.
HIDDEN = [
    "steering_lag", "steering_backlash", "axle_coupling", "reverse_steering_gain", "speed_lag", "cornering_speed_loss",
    "lateral_slip", "wheel_diameter_mismatch", "axle_speed_mismatch", "floor_tilt", "marker_offset",
    "heading_misalignment", "mocap_scale", "steering_lag_and_lateral_slip", "axle_coupling_and_battery_droop",
]  # fmt: skip


def hidden(spec, seed=5):
    return make_hidden_plant(spec, seed, floors=0.0).sealed_truth()


def true_model(truth):
    """The vehicle model that knows everything about a plant; its maps are the plant's, point by point."""
    c = truth.constants

    def table(*points):
        commands, outputs = zip(*sorted(points), strict=True)
        return MonotoneTable(tuple(1500.0 + u for u in commands), outputs, "linear")

    def steering(axle):
        slope, offset, low, high = (c[f"{axle}_{what}"] for what in ("slope", "offset", "low", "high"))
        return table((-600.0, high), ((high - offset) / slope, high), ((low - offset) / slope, low), (600.0, low))

    dead, reach = c["drive_dead"], 600.0 - c["drive_dead"]
    drive = table((-600.0, c["gain_forward"] * reach), (-dead, 0.0), (dead, 0.0), (600.0, -c["gain_backward"] * reach))
    effects = tuple(effect_kinds()[e.name](**e.parameters) for e in truth.effects)
    geometry = Geometry(c["front_axle"], c["rear_axle"])
    return VehicleModel("true", geometry, Channels.alike("us"), steering("front"), steering("rear"), drive, effects)


def driven(truth, commands, start, hours=0.0):
    """Where a plant without run-to-run play is seen to end, in the start frame."""
    plant = HiddenPlant(dict(truth.constants), (0.0, 0.0, 0.0), 1, truth, turnaround_s=0.0)
    plant.advance(1500.0, 1500.0, 1500.0, 3600.0 * hours)
    plant.reset(tuple(start), seed=1)
    times = np.append(commands.t_s, commands.t_s[-1] + REST_S)
    for i, hold_s in enumerate(np.diff(times)):
        seen = plant.advance(*commands.at(i), float(hold_s))
    return Pose(*seen).relative_to(start)


def miss(end, target):
    return np.array([*np.subtract(end[:2], target[:2]) * 1e3, math.degrees(end.relative_to(target).heading_rad)])


@pytest.mark.parametrize("spec", HIDDEN)
@pytest.mark.slow
def test_a_plant_with_hidden_effects_ends_on_target(spec):
    truth = hidden(spec, 5)
    model = true_model(truth)
    static = model.with_effects()
    off, left = [], []
    for name in EIGHT:
        trajectory = load_trajectory(name)
        made = corrected_plan(trajectory, model, start=START)
        uncorrected = plan(trajectory, static, start=START)
        off.append(miss(driven(truth, uncorrected.commands, START), made.target))
        left.append(miss(driven(truth, made.commands, START), made.target))
        # What the plan says of itself is what the plant does.
        np.testing.assert_allclose(made.correction.uncorrected.along_m * 1e3, off[-1][0], atol=1.0)
        np.testing.assert_allclose(made.correction.uncorrected.across_m * 1e3, off[-1][1], atol=1.0)
    assert np.abs(left).max() < 1.0  # mm and degrees
    assert np.abs(left).max() < 0.1 * np.abs(off).max()


@pytest.mark.parametrize("name", ["1", "4", "6"])
@pytest.mark.slow
def test_what_a_model_is_known_to_miss_is_taken_off_its_aim(name):
    truth, trajectory = hidden("lateral_slip_and_cornering_speed_loss"), load_trajectory(name)
    model = true_model(truth).with_effects(effect_kinds()["lateral_slip"]())  # all but the slip
    first = corrected_plan(trajectory, model, start=START)
    end = driven(truth, first.commands, START)
    missed = end.relative_to(Pose(*first.expected[-1, 1:]))
    made = corrected_plan(trajectory, model, start=START, end_pose_bias=missed)
    left = miss(driven(truth, made.commands, START), made.target)
    # To first order: of a decimetre some millimetres stay.
    assert np.abs(left).max() < max(0.15 * np.abs(miss(end, made.target)).max(), 0.1)
    assert made.correction.remaining.distance_m < 1e-4


@pytest.mark.parametrize("name", ["u_turn", "parallel_park", "s_curve", "figure_eight", "garage", "crab"])
def test_paths_of_several_legs(name):
    truth = hidden("speed_lag_and_cornering_speed_loss", 5)
    made = corrected_plan(load_trajectory(name), true_model(truth), start=START)
    assert np.abs(miss(driven(truth, made.commands, START), made.target)).max() < 1.5


@pytest.mark.parametrize("degrees", [-1.3, 1.0])
def test_full_circles_stay_near_the_plan_whatever_their_aim(calibrated, degrees):
    model, trajectory = calibrated.with_effects(SteeringLag(0.14)), load_trajectory("figure_eight")
    planned = plan(trajectory, calibrated).commands
    made = corrected_plan(trajectory, model, end_pose_bias=Pose(0.002, 0.0014, math.radians(degrees)))
    assert made.correction.remaining.distance_m < 1e-4
    for axle in ("front", "rear"):
        by_turn = getattr(made.commands, axle)[[0, -1]] - getattr(planned, axle)[[0, -1]]
        assert np.abs(by_turn).max() < 20.0  # µs; another way was 30 to 100 µs off


def test_campaign_time_counts():
    truth = hidden("battery_droop", 5)
    model, trajectory = true_model(truth), load_trajectory("3")
    late = Departure(started_h=0.5)
    made = corrected_plan(trajectory, model, departure=late)
    assert depends_on_time(made, model, late)
    fresh = corrected_plan(trajectory, model)
    ends = [driven(truth, p.commands, Pose(0.0, 0.0, 0.0), hours=0.5).x_m for p in (made, fresh)]
    assert abs(ends[0] - 2.0) < 0.002 < abs(ends[1] - 2.0)


def test_what_does_not_change_in_time_is_said(calibrated):
    model = calibrated.with_effects(SteeringLag(0.2))
    assert not depends_on_time(corrected_plan(load_trajectory("5"), model), model, Departure())


def test_nothing_to_correct_changes_nothing(calibrated):
    trajectory = load_trajectory("6")
    made, plain = corrected_plan(trajectory, calibrated), plan(trajectory, calibrated)
    for name, column in vars(plain.commands).items():
        np.testing.assert_allclose(getattr(made.commands, name), column, atol=1e-4)
    assert made.correction.remaining.distance_m < 1e-6


def test_what_the_camera_measures_wrongly_is_told(calibrated):
    correction = corrected_plan(load_trajectory("1"), calibrated.with_effects(MocapScale(0.02))).correction
    assert correction.remaining.distance_m < 2e-4
    assert correction.beyond_camera.along_m == pytest.approx(2.0 / 1.02 - 2.0, abs=1e-4)
    assert corrected_plan(load_trajectory("1"), calibrated).correction.beyond_camera is None


def test_a_front_steered_vehicle_meets_all_three(front_steered):
    model = front_steered.with_effects(FloorTilt(0.02, 1.2))
    made = corrected_plan(load_trajectory("front_only"), model)
    assert made.correction.uncorrected.distance_m > 5e-3
    assert made.correction.remaining.distance_m < 2e-4
    assert abs(made.correction.remaining.delta_heading_rad) < 1e-3


def test_what_cannot_be_made_up_for_is_said(calibrated):
    made = corrected_plan(load_trajectory("1"), calibrated.with_effects(BatteryDroop(0.999)), departure=_tired())
    assert made.correction.remaining.distance_m > 0.1
    assert made.correction.at_limits == ("duration",)


def _tired():
    return Departure(started_h=0.95)


def test_commands_of_its_own_and_no_target_stay_as_they_are(calibrated):
    for name in ("pulses", "endurance"):
        made = corrected_plan(load_trajectory(name), calibrated.with_effects(SteeringLag(0.3)))
        assert made.correction is None
        np.testing.assert_array_equal(made.commands.t_s, plan(load_trajectory(name), calibrated).commands.t_s)


def test_the_corrected_path_stays_on_the_floor(calibrated):
    slow, turning = calibrated.with_effects(SteeringLag(1.0)), load_trajectory("u_turn")
    plain, origin = plan(turning, slow), Pose(0.0, 0.0, 0.0)
    (left, low), (right, high) = plain.swept[:, 1:].min(axis=0) - 1e-3, plain.swept[:, 1:].max(axis=0) + 1e-3
    tight = Workspace.polygon([(left, low), (right, low), (right, high), (left, high)], margin_m=0.0)
    plan(turning, slow, workspace=tight, start=origin)
    with pytest.raises(PlanError, match=r"^u_turn: path leaves the workspace polygon:.* after \d\.\d s at"):
        corrected_plan(turning, slow, workspace=tight, start=origin)
    made = corrected_plan(turning, slow, workspace=Workspace.circle())
    reached = made.start.compose(Pose(*made.expected[-1, 1:]))
    assert made.start.compose(made.target).relative_to(reached) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_a_single_turn_keeps_one_steering_angle_however_much_it_changes(calibrated):
    model = calibrated.with_effects(effect_kinds()["lateral_slip"](3.0))
    assert len(corrected_plan(load_trajectory("5"), model).commands) == 3


@pytest.mark.parametrize(("radius_m", "at_limits"), [(0.5, ()), (0.475, ("front angle",))])
def test_the_range_of_a_channel_limits_a_correction_as_an_end_stop_does(radius_m, at_limits):
    alike = Channels.alike("normalised")
    channels, line = replace(alike, front=replace(alike.front, low=-1.0, high=1.0)), Line(0.6, 0.0)
    vehicle = VehicleModel("agv", Geometry(0.15, 0.15), channels, line, Fixed(command=0.0), Line(1.0, 0.0))
    segments = [{"kind": "arc", "turn": "left", "radius_m": radius_m, "angle_deg": 90.0}]
    turn = trajectory_from_table({"schema": 1, "name": "t", "steering": "front", "speed": 0.3, "segments": segments})
    made = corrected_plan(turn, vehicle.with_effects(WheelbaseError(0.06)))
    assert made.correction.at_limits == at_limits
    assert made.correction.remaining.distance_m < (0.02 if at_limits else 1e-3) < made.correction.uncorrected.distance_m
    assert np.abs(made.commands.front).max() <= 1.0
