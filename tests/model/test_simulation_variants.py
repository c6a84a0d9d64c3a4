"""Laws of another order against equations written out independently."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulation_truth import COMMANDS, FRAMES, LF, LR, REST, RUN_TIMES, SETTLED
from simulation_variants_truth import (
    aims,
    at_once,
    backlash_closes,
    body_share,
    drive,
    servo_path,
    sprung,
    true_form,
    with_play,
)

from agvbench.effects import effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.model.simulation.compose import kernel_text
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

START = (0.4, -0.3, 0.6)
ROWS = np.vstack([[*REST, 0.0], SETTLED])
INITIAL = np.array([[*START, 0.0]])
DRIVEN = Commands(RUN_TIMES, 1500.0 + COMMANDS[:, 0], 1500.0 + COMMANDS[:, 1], 1500.0 + COMMANDS[:, 2])
SIZES = [
    ("steering_lag_inertia", {"time_constant_s": 0.2, "inertia_s": 0.1}),
    ("steering_lag_inertia", {"time_constant_s": 0.12, "inertia_s": 0.15}),
    ("steering_lag_inertia", {"time_constant_s": 0.4, "inertia_s": 0.1}),
    ("steering_lag_uneven", {"time_constant_s": 0.2, "inertia_s": 0.1, "rear_ratio": 0.6}),
    ("steering_lag_uneven", {"time_constant_s": 0.12, "inertia_s": 0.0, "rear_ratio": 1.7}),
    ("steering_backlash_uneven", {"front_width_rad": 0.06, "rear_width_rad": 0.02}),
    ("steering_backlash_uneven", {"front_width_rad": 0.0, "rear_width_rad": 0.1}),
    ("steering_rate_limit_acceleration", {"rate_rad_per_s": 0.7, "acceleration_rad_per_s2": 4.0}),
    ("steering_rate_limit_acceleration", {"rate_rad_per_s": 3.0, "acceleration_rad_per_s2": 1.5}),
    ("steering_rate_limit_sides", {"rate_rad_per_s": 0.6, "right_ratio": 2.5}),
    ("steering_rate_limit_sides", {"rate_rad_per_s": 3.0, "right_ratio": 0.15}),
    ("steering_lag_distance", {"length_m": 0.06}),
    ("speed_lag_ramp", {"acceleration_mps2": 0.5, "braking_mps2": 0.35}),
    ("speed_lag_ramp_up", {"acceleration_mps2": 0.5, "brake_s": 0.2}),
    ("speed_lag_coasting", {"acceleration_mps2": 0.5, "coast_s": 0.2}),
    ("speed_lag_limited", {"powered_s": 0.15, "acceleration_mps2": 0.7, "coast_s": 0.2}),
    ("speed_lag_limited", {"powered_s": 0.4, "acceleration_mps2": 0.4, "coast_s": 0.1}),
    ("speed_lag_friction", {"accelerate_s": 0.2, "brake_s": 0.1, "coast_mps2": 0.5}),
    ("speed_lag_friction", {"accelerate_s": 0.02, "brake_s": 0.3, "coast_mps2": 0.4}),
    ("speed_lag_inertia", {"time_constant_s": 0.2, "inertia_s": 0.1}),
    ("speed_lag_inertia", {"time_constant_s": 0.12, "inertia_s": 0.15}),
    ("speed_lag_inertia", {"time_constant_s": 0.5, "inertia_s": 0.1}),
    ("speed_lag_controller", {"time_constant_s": 0.12, "inertia_s": 0.2, "coast_s": 0.05}),
    ("speed_lag_controller", {"time_constant_s": 0.5, "inertia_s": 0.1, "coast_s": 0.3}),
    ("speed_lag_motor", {"powered_s": 0.5, "damping_per_m": 6.0, "coast_s": 0.1}),
    ("speed_lag_motor", {"powered_s": 0.15, "damping_per_m": 1.0, "coast_s": 0.4}),
    (
        "speed_lag_spring_back",
        {"forward_mps2": 0.5, "backward_mps2": 0.9, "coast_s": 0.4, "spring_per_s2": 2.5, "relaxation_s": 0.5},
    ),
    (
        "speed_lag_spring_back",
        {"forward_mps2": 0.5, "backward_mps2": 0.9, "coast_s": 0.1, "spring_per_s2": 1.0, "relaxation_s": 0.5},
    ),
    (
        "speed_lag_spring_back",
        {
            "forward_mps2": 0.5,
            "backward_mps2": 0.9,
            "coast_s": 0.4,
            "spring_per_s2": 2.5,
            "relaxation_s": 0.5,
            "lag_s": 0.2,
            "backlash_m": 0.02,
        },
    ),
    ("mocap_latency_smoothing", {"latency_s": 0.03, "time_constant_s": 0.12}),
    ("mocap_latency_smoothing", {"latency_s": 0.0, "time_constant_s": 0.004}),
    ("mocap_latency_smoothing", {"latency_s": 0.0, "time_constant_s": 1.5}),
    ("actuation_delay_servos", {"steering_s": 0.2, "drive_s": 0.08}),
    ("actuation_delay_servos", {"steering_s": 0.0, "drive_s": 0.95}),
    ("actuation_delay_uneven", {"front_s": 0.2, "rear_s": 0.13, "drive_s": 0.08}),
    ("actuation_delay_uneven", {"front_s": 0.0, "rear_s": 0.0, "drive_s": 0.95}),
]
each = pytest.mark.parametrize(("name", "values"), SIZES)


def simulated(effects, *, begins_s=None, first=0, initial=INITIAL):
    run = SimulatedRun(DRIVEN, FRAMES[first:], begins_s=begins_s)
    simulation = Simulation(Geometry(LF, LR), NEUTRAL, [run], kinds=tuple(effect_variants().values()))
    return simulation.predict(ROWS, simulation.parameters(effects), initial)


@each
def test_a_law_of_another_order(name, values):
    predicted = simulated([effect_variants()[name](**values)])
    np.testing.assert_allclose(predicted, true_form(name, values, START, FRAMES), atol=3e-6)


# Where the true pose was behind smoothed ones is only known in a steady motion.
@pytest.mark.parametrize(("name", "values"), [s for s in SIZES if s[0] != "mocap_latency_smoothing"])
def test_a_window_goes_on_where_the_run_was(name, values):
    whole = true_form(name, values, START, FRAMES)
    for first in (20, 63, 90):
        initial = np.array([[*whole[first], np.nan]])
        predicted = simulated([effect_variants()[name](**values)], begins_s=FRAMES[first], first=first, initial=initial)
        np.testing.assert_allclose(predicted, whole[first:], atol=2e-5)


def test_a_window_of_smoothed_poses_begins_as_in_a_steady_motion():
    law = effect_variants()["mocap_latency_smoothing"](0.0, 0.1)
    whole = simulated([law])
    first = int(np.searchsorted(FRAMES, 1.25))  # a second after the last change
    initial = np.array([[*whole[first], np.nan]])
    predicted = simulated([law], begins_s=FRAMES[first], first=first, initial=initial)
    np.testing.assert_allclose(predicted, whole[first:], atol=3e-4)


@pytest.mark.parametrize(
    ("form", "library"),
    [
        (("steering_lag_inertia", (0.15, 0.0)), ("steering_lag", (0.15,))),
        (("steering_lag_inertia", (0.15, 1e-3)), ("steering_lag", (0.15,))),
        (("steering_lag_uneven", (0.15, 0.08, 1.0)), ("steering_lag_inertia", (0.15, 0.08))),
        (("steering_backlash_uneven", (0.06, 0.06)), ("steering_backlash", (0.06,))),
        (("steering_rate_limit_acceleration", (1.2, math.inf)), ("steering_rate_limit", (1.2,))),
        (("speed_lag_spring_back", (0.5, 0.5, 0.2, 0.0, 0.5)), ("speed_lag_coasting", (0.5, 0.2))),
        (("speed_lag_spring_back", (0.5, 0.5, 0.2, 1e-6, 0.5)), ("speed_lag_coasting", (0.5, 0.2))),
        (("speed_lag_inertia", (0.2, 0.0)), ("speed_lag", (0.2, 0.2))),
        (("speed_lag_controller", (0.2, 0.0, 0.2)), ("speed_lag", (0.2, 0.2))),
        (("speed_lag_friction", (0.2, 0.1, math.inf)), ("speed_lag", (0.2, 0.1))),
        (("speed_lag_limited", (0.2, math.inf, 0.2)), ("speed_lag", (0.2, 0.2))),
        (("speed_lag_limited", (0.0, 0.5, 0.2)), ("speed_lag_coasting", (0.5, 0.2))),
        (("speed_lag_motor", (0.2, 0.0, 0.2)), ("speed_lag", (0.2, 0.2))),
        (("steering_rate_limit_sides", (1.2, 1.0)), ("steering_rate_limit", (1.2,))),
        (("speed_lag_inertia", (0.2, 1e-3)), ("speed_lag", (0.2, 0.2))),
        (("mocap_latency_smoothing", (0.07, 0.0)), ("mocap_latency", (0.07,))),
        (("mocap_latency_smoothing", (0.0, 1e-4)), ("mocap_latency", (1e-4,))),
        (("actuation_delay_servos", (0.07, 0.07)), ("actuation_delay", (0.07,))),
        (("actuation_delay_uneven", (0.07, 0.07, 0.07)), ("actuation_delay", (0.07,))),
    ],
)
def test_it_has_the_librarys_law_for_a_limit(form, library):
    ours = simulated([effect_variants()[form[0]](*form[1])])
    kinds = {**effect_kinds(), **effect_variants()}
    np.testing.assert_allclose(ours, simulated([kinds[library[0]](*library[1])]), atol=1e-4)


def test_an_axle_that_swings_faster_than_anybody_sees_costs_no_more_than_one_that_does_not():
    """Swing by swing, 8 s of a thousandth of this inertia would be millions of steps."""
    ours = simulated([effect_variants()["steering_lag_inertia"](0.0, 1e-6)])
    np.testing.assert_allclose(ours, simulated([]), atol=1e-4)


def test_the_windup_lasts_over_commands_without_power_and_relaxes_under_power():
    """The vehicle coasts, steers while it coasts, drives on before the windup has relaxed, and coasts again."""
    values = {"forward_mps2": 0.8, "backward_mps2": 0.5, "coast_s": 0.4, "spring_per_s2": 3.0, "relaxation_s": 0.7}
    moments = np.array([0.1, 1.2, 1.5, 1.9, 2.3])
    settled = np.array([[0.2, 0.0, 0.3], [0.2, 0.0, 0.0], [-0.1, 0.1, 0.0], [0.0, 0.2, -0.25], [0.0, 0.2, 0.0]])
    frames = np.arange(0.0, 5.0, 0.04)
    ids = np.arange(1.0, 6.0)
    run = SimulatedRun(Commands(moments, 1500.0 + ids, 1500.0 + ids, 1500.0 + ids), frames)
    kinds = tuple(effect_variants().values())
    simulation = Simulation(Geometry(LF, LR), NEUTRAL, [run], kinds=kinds)
    law = effect_variants()["speed_lag_spring_back"](**values)
    rows = np.vstack([[*REST, 0.0], settled])
    predicted = simulation.predict(rows, simulation.parameters([law]), INITIAL)
    front, rear = (at_once(np.r_[REST[i], settled[:, i]], moments) for i in (0, 1))
    speed = sprung(at_once(np.r_[0.0, settled[:, 2]], moments), body_share(front, rear), moments, values, 6.0)
    truth = drive(front, rear, speed, np.array(START), frames, moments, 0.0)
    np.testing.assert_allclose(predicted, truth, atol=3e-6)


def test_a_backlash_is_closed_by_several_commands_and_opens_at_every_stop():
    """A slow command does not close it, a faster one does; a stop before it is closed leaves the vehicle at rest."""
    values = {
        "forward_mps2": 2.0, "backward_mps2": 2.0, "coast_s": 0.1, "spring_per_s2": 0.0, "lag_s": 0.05,
        "relaxation_s": 0.5, "backlash_m": 0.03,
    }  # fmt: skip
    moments = np.array([0.1, 0.4, 0.5, 1.5, 2.5, 2.6, 3.6])
    speeds = np.array([0.05, 0.1, 0.3, 0.0, -0.2, 0.0, 0.25])
    frames = np.arange(0.0, 4.5, 0.04)
    ids = np.arange(1.0, 8.0)
    run = SimulatedRun(Commands(moments, 1500.0 + ids, 1500.0 + ids, 1500.0 + ids), frames)
    simulation = Simulation(Geometry(LF, LR), NEUTRAL, [run], kinds=tuple(effect_variants().values()))
    parameters = simulation.parameters([effect_variants()["speed_lag_spring_back"](**values)])
    angles = np.tile([0.2, -0.1], (8, 1))
    predicted = simulation.predict(np.column_stack([angles, np.r_[0.0, speeds]]), parameters, INITIAL)
    moved, rows = backlash_closes(moments, speeds, values["backlash_m"])
    assert rows == [2, 3, 5, 6]
    assert moved[0] == pytest.approx(moments[2] + 0.005 / 0.3, abs=1e-6)
    front, rear = (lambda _: 0.2), (lambda _: -0.1)
    speed = sprung(at_once(np.r_[0.0, speeds[rows]], moved), body_share(front, rear), moved, values, 6.0)
    truth = drive(front, rear, speed, np.array(START), frames, moved, 0.0)
    np.testing.assert_allclose(predicted, truth, atol=3e-6)
    at_rest = (frames > 2.5 + 0.3) & (frames < 3.6)
    assert np.ptp(predicted[at_rest], axis=0).max() < 1e-6


def test_critical_damping_is_no_edge():
    near = [simulated([effect_variants()["steering_lag_inertia"](0.2, tau)]) for tau in (0.1 - 1e-9, 0.1, 0.1 + 1e-9)]
    np.testing.assert_allclose(near[1] - near[0], near[2] - near[1], atol=2e-6)
    np.testing.assert_allclose(near[0], near[2], atol=2e-6)


def test_a_servo_has_a_damping_ratio_of_at_least_a_fifth():
    ringing, damped, more = (
        simulated([effect_variants()["steering_lag_inertia"](lag, 0.1)]) for lag in (0.0, 0.04, 0.05)
    )
    np.testing.assert_array_equal(ringing, damped)
    assert np.max(np.abs(more - damped)) > 1e-4


def test_a_drive_that_overshoots_many_times_comes_to_rest_and_reverses():
    """A damping of 0.1: the speed crosses zero several times after a stop, and before it after a start backward."""
    values = {"time_constant_s": 0.06, "inertia_s": 0.3}
    predicted = simulated([effect_variants()["speed_lag_inertia"](**values)])
    np.testing.assert_allclose(predicted, true_form("speed_lag_inertia", values, START, FRAMES), atol=1e-5)


@pytest.mark.parametrize(
    "law",
    [
        ("steering_lag_inertia", {"time_constant_s": 0.1, "inertia_s": 0.15}),
        ("steering_rate_limit_acceleration", {"rate_rad_per_s": 3.0, "acceleration_rad_per_s2": 1.5}),
    ],
)
def test_an_axle_with_play_is_taken_along_to_where_its_servo_turns_back(law):
    name, values = law
    width = 0.06
    predicted = simulated([effect_variants()[name](**values), effect_kinds()["steering_backlash"](width)])
    moments, end = RUN_TIMES, FRAMES[-1] + 2.0
    paths = [servo_path(name, values, channel, moments, end) for channel in (0, 1)]
    behind = [with_play(path, rest, width, end) for path, rest in zip(paths, REST, strict=True)]
    truth = drive(behind[0], behind[1], aims(2, moments), np.array(START), FRAMES, moments, 0.0)
    np.testing.assert_allclose(predicted, truth, atol=1.5e-5)


def test_the_branch_for_servos_of_second_order_is_compiled_where_it_is_needed_only():
    library, forms = tuple(effect_kinds().values()), tuple(effect_variants().values())
    assert "actuate_any_order" not in kernel_text(library)
    assert "actuate_any_order as actuate" in kernel_text((*library, *forms))
