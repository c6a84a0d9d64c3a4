"""The sign of every effect, as its name promises, on drives simple enough to say what must happen.

The truth here is in words: a lag falls behind, a loss is shorter, a positive curvature turns left.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from agvbench.effects import effect_kinds
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

GEOMETRY = Geometry(0.18, 0.12)
LEFT = (0.3, -0.3, 0.3)
RIGHT = (-0.3, 0.3, 0.3)
STRAIGHT = (0.0, 0.0, 0.3)


def drive(row, effect=None, *, seconds=2.0, started_h=0.0, then=None, geometry=GEOMETRY, **values):
    """Drive one command, then perhaps another, each for some seconds; return the pose at the end."""
    rows = [row] if then is None else [row, then]
    times = seconds * np.arange(float(len(rows)))
    commands = Commands(times, *(1500.0 + 100.0 * np.array(rows).T[[2, 0, 1]]))
    run = SimulatedRun(commands, np.array([0.0, seconds * len(rows)]), started_h)
    simulation = Simulation(geometry, NEUTRAL, [run])
    effects = [] if effect is None else [effect_kinds()[effect](**values)]
    settled = np.vstack([[0.0, 0.0, 0.0], *rows])
    return simulation.predict(settled, simulation.parameters(effects), np.zeros((1, 4)))[-1]


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("actuation_delay", {"delay_s": 0.2}),
        ("mocap_latency", {"latency_s": 0.2}),
        ("speed_lag", {"accelerate_s": 0.2}),
    ],
)
def test_late_means_not_as_far(effect, values):
    assert drive(STRAIGHT)[0] == pytest.approx(0.6)
    assert drive(STRAIGHT, effect, **values)[0] == pytest.approx(0.54, abs=1e-4)


def test_braking_late_means_further():
    stop = (0.0, 0.0, 0.0)
    assert drive(STRAIGHT, "speed_lag", then=stop, brake_s=0.2)[0] == pytest.approx(0.6 + 0.2 * 0.3, abs=1e-4)


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("steering_lag", {"time_constant_s": 0.3}),
        ("steering_rate_limit", {"rate_rad_per_s": 0.5}),
        ("steering_backlash", {"width_rad": 0.05}),
        ("steering_saturation", {"front_rad": 0.2}),
        ("steering_saturation", {"rear_rad": 0.2}),
        ("lateral_slip", {"gradient": 1.0}),
        ("wheelbase_error", {"longer": 0.1}),
        ("axle_coupling", {"front_from_rear": 0.1}),
        ("axle_coupling", {"rear_from_front": 0.1}),
    ],
)
def test_turns_less_to_either_side(effect, values):
    for turn in (LEFT, RIGHT):
        assert 0.3 < drive(turn, effect, **values)[2] / drive(turn)[2] < 0.99


def test_backward_gain_steers_more_backward_only():
    backward = (0.3, -0.3, -0.3)
    assert drive(LEFT, "reverse_steering_gain", gain=0.1)[2] == drive(LEFT)[2]
    assert drive(backward, "reverse_steering_gain", gain=0.1)[2] / drive(backward)[2] > 1.05


def test_cornering_costs_speed_in_turns_only():
    assert drive(STRAIGHT, "cornering_speed_loss", loss=0.1)[0] == drive(STRAIGHT)[0]
    expected = 1.0 - 0.1 * 2.0 * math.tan(0.3)
    for turn in (LEFT, RIGHT):
        assert drive(turn, "cornering_speed_loss", loss=0.1)[2] / drive(turn)[2] == pytest.approx(expected)


def test_the_battery_droops_by_the_hour():
    later = drive(STRAIGHT, "battery_droop", per_hour=0.1, started_h=2.0)[0]
    assert later == pytest.approx(0.6 * 0.8, abs=1e-4)


def test_a_dead_band_takes_off_small_commands_altogether():
    # Commands are 100 per m/s here: 30 from neutral.
    assert drive(STRAIGHT, "drive_dead_band", width=31.0)[0] == 0.0
    assert drive(STRAIGHT, "drive_dead_band", width=10.0)[0] == pytest.approx(0.4)


def test_faster_rear_wheels_drive_faster():
    assert drive(STRAIGHT, "axle_speed_mismatch", ratio=0.1)[0] == pytest.approx(0.6 * 1.05)


def test_positive_curvature_is_left_forward_and_clockwise_backward():
    assert drive(STRAIGHT, "wheel_diameter_mismatch", curvature_per_m=0.1)[2] == pytest.approx(0.06)
    assert drive((0.0, 0.0, -0.3), "wheel_diameter_mismatch", curvature_per_m=0.1)[2] == pytest.approx(-0.06)


def test_a_tilted_floor_drifts_while_moving():
    up = drive(STRAIGHT, "floor_tilt", drift_mps=0.01, direction_rad=math.pi / 2)
    assert up == pytest.approx([0.6, 0.02, 0.0], abs=1e-6)
    assert drive((0.0, 0.0, 0.0), "floor_tilt", drift_mps=0.01) == pytest.approx([0.0, 0.0, 0.0])


def test_markers_ahead_go_round_in_front():
    # Half a turn about the centroid's circle: the offset turns with the vehicle, from where it was at the start.
    heading = drive(LEFT)[2]
    ahead = drive(LEFT, "marker_offset", forward_m=0.1) - drive(LEFT)
    assert ahead == pytest.approx([0.1 * (math.cos(heading) - 1.0), 0.1 * math.sin(heading), 0.0], abs=1e-7)
    left = drive(LEFT, "marker_offset", left_m=0.1) - drive(LEFT)
    assert left == pytest.approx([-0.1 * math.sin(heading), 0.1 * (math.cos(heading) - 1.0), 0.0], abs=1e-7)


def test_with_a_longer_wheelbase_each_axle_is_half_of_it_farther_away():
    longer, turn = Geometry(GEOMETRY.front_axle_m + 0.015, GEOMETRY.rear_axle_m + 0.015), (0.3, 0.1, 0.3)
    assert drive(turn, "wheelbase_error", longer=0.1) == pytest.approx(drive(turn, geometry=longer))


def test_a_misaligned_heading_drives_to_the_other_side():
    # It looks 0.1 further left than it goes.
    askew = drive(STRAIGHT, "heading_misalignment", angle_rad=0.1)
    assert askew == pytest.approx([0.6 * math.cos(0.1), -0.6 * math.sin(0.1), 0.0])


def test_a_longer_metre_measures_further():
    assert drive(STRAIGHT, "mocap_scale", scale=0.05)[0] == pytest.approx(0.63)
