"""Predictions against a trajectory worked out by hand, a fine integration in time, and the vehicle model's rollout."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.model import thesis_vehicle
from agvbench.thesis.prediction.assumptions import (
    MEANING,
    Assumptions,
    choices,
    concerning,
    every_combination,
    one_at_a_time,
)
from agvbench.thesis.prediction.commands import commanded, cut_to_degrees
from agvbench.thesis.prediction.end_pose import arc_end, driven, driven_distance, predict
from agvbench.thesis.prediction.trajectories import EIGHT, wanted_angles
from agvbench.thesis.tables import GEOMETRY
from agvbench.types import Commands

LF, LR = 0.181, 0.121
NO_LOSS = Assumptions(cornering_loss="none")


def interpolated_line(pulses, degrees):
    """Least squares line through the points two away from each end, by the textbook formula."""
    x, y = pulses[2:-2], degrees[2:-2]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / sum((a - mean_x) ** 2 for a in x)
    return lambda p: math.radians(mean_y + slope * (p - mean_x))


PULSES = [900 + 100 * i for i in range(13)]
FRONT = [40.21, 40.17, 33.65, 24.75, 16.17, 7.57, -1.59, -9.72, -18.28, -26.61, -35.47, -41.22, -42.06]
REAR = [40.39, 39.23, 32.50, 24.01, 15.26, 7.14, -2.27, -11.30, -20.13, -28.99, -37.48, -39.18, -39.76]


def drive_by_hand(front_us, rear_us, axle_mps, duration_s, steps=20_000):
    """Integrate the rigid body in time: two axle points that move along their wheels."""
    front, rear = interpolated_line(PULSES, FRONT)(front_us), interpolated_line(PULSES, REAR)(rear_us)
    forward = axle_mps * 0.5 * (math.cos(front) + math.cos(rear))
    yaw_rate = forward * (math.tan(front) - math.tan(rear)) / (LF + LR)
    # The rear axle's point drives along its wheels; the markers ride LR ahead of it.
    left = forward * math.tan(rear) + LR * yaw_rate
    x = y = heading = 0.0
    dt = duration_s / steps
    for _ in range(steps):
        middle = heading + 0.5 * yaw_rate * dt
        x += dt * (forward * math.cos(middle) - left * math.sin(middle))
        y += dt * (forward * math.sin(middle) + left * math.cos(middle))
        heading += yaw_rate * dt
    return x, y, heading


def straight_speed_at_neutral():
    """Return how much faster the axles go than the markers when both servos get 1500 µs."""
    front, rear = interpolated_line(PULSES, FRONT)(1500.0), interpolated_line(PULSES, REAR)(1500.0)
    beta = math.atan((LF * math.tan(rear) + LR * math.tan(front)) / (LF + LR))
    return 2.0 * math.cos(beta) / (math.cos(front) + math.cos(rear))


@pytest.mark.parametrize(("number", "side"), [(5, 1), (6, -1)])
def test_a_calibrated_turn_worked_out_by_hand(number, side):
    front_deg, rear_deg = side * math.degrees(math.atan(0.181)), -side * math.degrees(math.atan(0.121))
    front_us, rear_us = (125.00 - front_deg) / 0.0840, (123.55 - rear_deg) / 0.0837
    # Eq. 7.3 with all its digits is 0.32 m/s at 1198.4 µs; table 7.4 shows 0.3224 for all pulses below 1200.
    cubic = np.polynomial.Polynomial([-10.8569928013, 0.0243016652955, -1.69803843216e-5, 3.74194433018e-9])
    drive_us = min(r.real for r in (cubic - 0.32).roots() if 1161.0 < r.real < 1250.0)
    axle = float(thesis_vehicle().speed(drive_us)) * straight_speed_at_neutral()
    x, y, heading = drive_by_hand(front_us, rear_us, axle, (math.pi / 2.0) / 0.32)

    found = predict(EIGHT[number - 1], "calibrated", NO_LOSS)

    assert found.command.front_us == pytest.approx(front_us, abs=1e-6)
    assert found.command.rear_us == pytest.approx(rear_us, abs=1e-6)
    assert found.command.drive_us == pytest.approx(drive_us, abs=0.01)
    assert (found.end.x_m, found.end.y_m) == pytest.approx((x, y), abs=2e-6)
    assert found.turned_deg == pytest.approx(math.degrees(heading), abs=1e-4)
    assert found.delta_s_mm == pytest.approx(1000.0 * (math.hypot(x, y) - math.sqrt(2.0)), abs=2e-3)


def test_an_uncalibrated_straight_worked_out_by_hand():
    axle = 0.3224 * straight_speed_at_neutral()
    x, y, heading = drive_by_hand(1500.0, 1500.0, axle, 2.0 / 0.32)
    found = predict(EIGHT[0], "uncalibrated", Assumptions())
    assert found.command[:3] == (900.0, 1500.0, 1500.0)
    # The plateau of table 7.4 is 0.322…0.324: half a mm/s over 6.25 s is 3 mm.
    assert found.end.x_m == pytest.approx(x, abs=4e-3)
    assert found.end.y_m == pytest.approx(y, abs=1e-3)
    assert found.turned_deg == pytest.approx(math.degrees(heading), abs=0.03)


@pytest.mark.parametrize("condition", ["uncalibrated", "calibrated"])
def test_the_models_rollout_ends_where_the_closed_form_does(condition):
    model = thesis_vehicle()
    # The model's drive gives axle speeds, the thesis' table those of the markers at 1500 µs.
    front, rear = (float(a) for a in model.axle_angles(1500.0, 1500.0))
    beta = math.atan((LF * math.tan(rear) + LR * math.tan(front)) / (LF + LR))
    stretch = 2.0 * math.cos(beta) / (math.cos(front) + math.cos(rear))
    predictions = [predict(t, condition, NO_LOSS) for t in driven(condition)]
    commands = [Commands(np.array([0.0]), *(np.array([float(u)]) for u in p.command[:3])) for p in predictions]
    times = [np.array([p.command.duration_s * stretch]) for p in predictions]
    ends = model.rollout(commands, np.zeros((len(predictions), 3)), times)
    for prediction, end in zip(predictions, ends, strict=True):
        assert end[-1, :2] == pytest.approx((prediction.end.x_m, prediction.end.y_m), abs=1e-6)
        assert end[-1, 2] == pytest.approx(math.radians(prediction.turned_deg), abs=1e-6)


@pytest.mark.parametrize("trajectory", EIGHT, ids=lambda t: str(t.number))
def test_abeam_steering_reaches_the_target_exactly(trajectory):
    """What is asked for is right: a vehicle that does as told ends at (±1, ±1) with the target heading."""
    front, rear = wanted_angles(trajectory.side, "abeam", GEOMETRY)
    length = trajectory.drive * trajectory.path_m
    end, turned = arc_end(length, math.atan(LF * math.tan(rear) + LR * math.tan(front)), trajectory.side * length)
    assert turned == pytest.approx(trajectory.heading_rad if trajectory.is_turn else 0.0)
    goal = (trajectory.drive, trajectory.side) if trajectory.is_turn else (2.0 * trajectory.drive, 0.0)
    assert (end.x_m, end.y_m) == pytest.approx(goal)
    assert math.tan(front) - math.tan(rear) == pytest.approx(trajectory.side * (LF + LR))


@pytest.mark.parametrize("ramps", ["none", "accelerate_and_brake", "with_rebound"])
@pytest.mark.parametrize("speed", [0.32, 0.16, -0.32])
def test_ramps_against_integration(ramps, speed):
    duration, dt = 6.25, 1e-4
    v = position = 0.0
    if ramps == "none":
        assert driven_distance(speed, duration, ramps) == pytest.approx(speed * duration)
        return
    for step in range(int(9.0 / dt)):
        braking = step * dt >= duration
        v = max(0.0, v - dt * 0.3 / 0.588) if braking else min(abs(speed), v + dt * 0.3 / 0.294)
        position += v * dt
    if ramps == "with_rebound":
        rise = 0.1 / (0.3 / 0.588)
        position -= 0.1 * rise  # a triangle, `rise` seconds up and down
    assert driven_distance(speed, duration, ramps) == pytest.approx(math.copysign(position, speed), abs=2e-4)


@given(st.floats(-45.0, 45.0))
def test_whole_degrees(angle):
    for how in ("rounded", "toward_straight", "servo_floor"):
        cut = cut_to_degrees(angle, how)
        assert cut == round(cut)
        assert abs(cut - angle) < 1.0 + 1e-9
    assert cut_to_degrees(angle, "none") == angle
    assert abs(cut_to_degrees(angle, "toward_straight")) <= abs(angle)
    assert cut_to_degrees(angle, "rounded") == -cut_to_degrees(-angle, "rounded")
    assert cut_to_degrees(angle, "servo_floor") >= angle - 1e-9


def test_uncalibrated_pulses_follow_the_nominal_map():
    command = commanded(EIGHT[4], "uncalibrated", Assumptions())
    assert command.front_us == pytest.approx(1500.0 - math.degrees(math.atan(0.181)) * 600.0 / 45.0)
    assert command.rear_us == pytest.approx(1500.0 + math.degrees(math.atan(0.121)) * 600.0 / 45.0)
    assert command.duration_s == pytest.approx(math.pi / 2.0 / 0.32)
    whole = commanded(EIGHT[4], "uncalibrated", Assumptions(whole_degrees="toward_straight"))
    assert whole.front_us == pytest.approx(1500.0 - 10.0 * 600.0 / 45.0)


def test_every_choice_means_something_and_every_combination_occurs_once():
    names = Assumptions.__dataclass_fields__
    assert set(MEANING) == {(name, choice) for name in names for choice in choices(name)}
    for condition in ("uncalibrated", "calibrated"):
        found = list(every_combination(condition))
        expected = math.prod(len(choices(name)) for name in concerning(condition))
        assert len(found) == len(set(found)) == expected
    assert len(list(one_at_a_time(Assumptions()))) == sum(len(choices(n)) - 1 for n in names)


def test_every_assumption_matters_somewhere():
    """An assumption that changes no prediction would be decoration."""
    base = {(t.number, c): predict(t, c, Assumptions()) for c in ("uncalibrated", "calibrated") for t in driven(c)}
    for name, choice, changed in one_at_a_time(Assumptions()):
        after = {key: predict(before.trajectory, key[1], changed) for key, before in base.items()}
        moved = [
            key
            for key, before in base.items()
            if abs(after[key].delta_s_mm - before.delta_s_mm) + abs(after[key].turned_deg - before.turned_deg) > 1e-6
        ]
        assert moved, (name, choice)
        assert all(name in concerning(condition) for _, condition in moved), (name, choice)
