"""The vehicle plant: time, seeds, limits, symmetry."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import agvbench.simulator
from agvbench.errors import PlantError
from agvbench.simulator import dynamics, make_plant, random_plant, small_plant
from agvbench.simulator.plants import SMALL_VEHICLE, THESIS_VEHICLE, random_vehicle
from agvbench.simulator.vehicle_parameters import flatten
from agvbench.simulator.vehicle_plant import VehiclePlant
from agvbench.types import Plant, Pose

pulses = st.floats(900.0, 2100.0)
COMMAND = (1000.0, 1300.0, 1620.0)


def fresh(seed=0, pose=(0.0, 0.0, 0.0), make=make_plant):
    plant = make(seed)
    plant.reset(pose, seed=1)
    return plant


def test_the_simulator_imports_no_physics_of_the_package():
    names = set()
    for path in Path(agvbench.simulator.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                names.add(node.module)
            elif isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
    ours = {name for name in names if name.startswith("agvbench") and not name.startswith("agvbench.simulator")}
    assert ours == {"agvbench.types", "agvbench.errors", "agvbench.compiled"}


def test_the_integrator_reads_the_constants_where_they_are_packed():
    names = [name for name, _ in flatten(THESIS_VEHICLE)]
    assert names[dynamics.REAR + dynamics.STOP_HIGH] == "rear.stop_high_rad"
    assert names[dynamics.FRONT + dynamics.RATE_LIMIT] == "front.rate_limit_rad_per_s"
    assert names[dynamics.FORWARD + dynamics.DEAD_BAND] == "forward.dead_band"
    assert names[dynamics.BACKWARD + dynamics.ACCELERATION] == "backward.acceleration_mps2"
    for group, constants in {
        "drive": "SENSE STIFFNESS OVERRUN REAR_RATIO SCRUB SCRUB_DRY "
        "BRAKE BRAKE_DRY WINDUP_RATE WINDUP_RELAXES DRIVE_BACKLASH",
        "body": "FRONT_AXLE REAR_AXLE MARKER_LEFT RELIEF UNDERSTEER",
        "battery": "CAPACITY RUNNING DROOP SHAPE",
    }.items():
        first = names.index(next(name for name in names if name.startswith(group)))
        declared = [name for name in names if name.startswith(f"{group}.")]
        places = [getattr(dynamics, constant) for constant in constants.split()]
        assert places == list(range(first, first + len(declared)))
    last = [names[i] for i in (dynamics.NEUTRAL, dynamics.COMMAND_LOW, dynamics.COMMAND_HIGH, dynamics.DELAY_FRAMES)]
    assert last == ["neutral", "command_low", "command_high", "delay_frames"]
    assert len(names) == dynamics.DELAY_FRAMES + 1


@given(st.lists(st.floats(0.0, 0.2), min_size=1, max_size=12), pulses, pulses, pulses)
@settings(max_examples=60, deadline=None)
def test_how_time_is_split_changes_nothing(parts, drive, front, rear):
    split, whole = fresh(), fresh()
    pose = (0.0, 0.0, 0.0)
    for dt in parts:
        pose = split.advance(drive, front, rear, dt)
    assert pose == pytest.approx(whole.advance(drive, front, rear, math.fsum(parts)), abs=1e-10)


@pytest.mark.parametrize("rate", [60, 120, 240, 1200])
def test_on_the_grid_it_changes_no_bit(rate):
    split, whole = fresh(), fresh()
    for _ in range(rate):
        split.advance(*COMMAND, 1.0 / rate)
    assert split.advance(*COMMAND, 0.0) == whole.advance(*COMMAND, 1.0)


def test_commands_take_effect_at_the_same_instant_however_time_is_split():
    split, whole = fresh(), fresh()
    for command, seconds in ((COMMAND, 1.0), ((1900.0, 1700.0, 1400.0), 0.5), ((1500.0,) * 3, 0.75)):
        for _ in range(round(seconds / 0.01)):
            split.advance(*command, 0.01)
        whole.advance(*command, seconds)
    assert split.advance(*COMMAND, 0.0) == whole.advance(*COMMAND, 0.0)


def test_halving_the_step_changes_a_minute_of_driving_by_less_than_a_tenth_of_a_millimetre():
    """Against the same equations on a grid eight times finer, in plain Python: a check of the integrator alone."""
    plant = VehiclePlant(replace(THESIS_VEHICLE, delay_frames=0.0), 0)
    plant.reset((0.0, 0.0, 0.0), seed=4)
    constants, run_variation, work = plant._constants, plant._run_variation, np.empty((3, dynamics.MOVING))
    fine, phase = plant._state.copy(), int(plant._counters[0])
    counters = np.array([0, 0])
    for step in range(8 * 1200):
        if step % 8 == 0 and (step // 8 + phase) % dynamics.FRAME_STEPS == 0:
            dynamics._latch(constants, run_variation, fine, counters, COMMAND)
        dynamics._step(constants, run_variation, fine, dynamics.STEP_S / 8, work)
        fine[: dynamics.MOVING] = work[2]
    coarse = plant.advance(*COMMAND, 1.0)
    assert coarse == pytest.approx(tuple(fine[:3]), abs=2e-5)


@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0), st.floats(-4.0, 4.0))
@settings(max_examples=30, deadline=None)
def test_the_floor_has_no_preferred_place_or_direction(x, y, heading):
    start = Pose(x, y, heading)
    at_origin = Pose(*fresh().advance(*COMMAND, 2.0))
    moved = Pose(*fresh(pose=start).advance(*COMMAND, 2.0)).relative_to(start)
    assert moved == pytest.approx(at_origin, abs=1e-9)


def test_axles_do_not_move_sideways():
    plant = fresh()
    plant.advance(*COMMAND, 2.0)
    body, state = plant.vehicle.body, plant.true_state()
    before, after = plant.advance(*COMMAND, 1e-4), plant.advance(*COMMAND, 1e-4)
    heading, yaw_rate = 0.5 * (before[2] + after[2]), (after[2] - before[2]) / 1e-4
    velocity = np.subtract(after[:2], before[:2]) / 1e-4
    left = -math.sin(heading) * velocity[0] + math.cos(heading) * velocity[1]
    ahead = math.cos(heading) * velocity[0] + math.sin(heading) * velocity[1]
    front = math.atan2(left + body.front_axle_m * yaw_rate, ahead)
    rear = math.atan2(left - body.rear_axle_m * yaw_rate, ahead)
    assert front == pytest.approx(state["front_rad"] + state["play_front_rad"], abs=1e-6)
    assert rear == pytest.approx(state["rear_rad"] + state["play_rear_rad"], abs=1e-6)


def test_commands_beyond_the_range_are_clipped_as_a_servo_does():
    assert fresh().advance(0.0, 5000.0, -1e9, 1.0) == fresh().advance(900.0, 2100.0, 900.0, 1.0)


@pytest.mark.parametrize("bad", [(math.nan, 0, 0, 1), (0, math.inf, 0, 1), (0, 0, "x", 1), (0, 0, 0, math.nan), (0, 0, 0, 1e6)])  # fmt: skip  # noqa: E501
def test_what_is_no_command_is_an_error_and_moves_nothing(bad):
    plant = fresh()
    plant.advance(*COMMAND, 0.5)
    state = plant.true_state()
    with pytest.raises(PlantError):
        plant.advance(*bad)
    assert plant.true_state() == state


def test_numpy_and_whole_numbers_are_commands():
    assert fresh().advance(1000, np.float32(1300), np.float64(1620), 1) == fresh().advance(*COMMAND, 1.0)


def test_a_reset_keeps_the_charge_and_draws_new_play():
    plant = fresh()
    plant.advance(*COMMAND, 5.0)
    drawn, run_variation = plant.true_state()["charge_ah"], plant.true_state()["play_front_rad"]
    plant.reset((1.0, 2.0, 3.0), seed=2)
    state = plant.true_state()
    assert (state["x_m"], state["y_m"], state["heading_rad"], state["speed_mps"]) == (1.0, 2.0, 3.0, 0.0)
    assert state["charge_ah"] == drawn > 0.0
    assert state["play_front_rad"] != run_variation
    plant.reset((0.0, 0.0, 0.0), seed=1)
    assert plant.true_state()["play_front_rad"] == run_variation


def test_play_scatters_as_declared():
    plant, drawn = make_plant(3), []
    for seed in range(2000):
        plant.reset((0.0, 0.0, 0.0), seed=seed)
        drawn.append([plant.true_state()[name] for name in ("play_front_rad", "play_rear_rad", "play_speed")])
    run_variation = THESIS_VEHICLE.run_variation
    assert np.std(drawn, axis=0) == pytest.approx(
        [run_variation.front_rad, run_variation.rear_rad, run_variation.speed], rel=0.06
    )
    assert np.abs(np.corrcoef(np.transpose(drawn)) - np.eye(3)).max() < 0.08


@pytest.mark.parametrize("seed", [0, -1, 2**70])
def test_any_whole_number_is_a_seed(seed):
    plant = make_plant(seed)
    plant.reset((0.0, 0.0, 0.0), seed=seed)
    assert isinstance(plant, Plant)


def test_commands_wait_for_the_pulse_frame_and_the_delay():
    begun = []
    for seed in range(40):
        plant = VehiclePlant(replace(THESIS_VEHICLE, delay_frames=2.0), 0)
        plant.reset((0.0, 0.0, 0.0), seed=seed)
        steps = next(i for i in range(200) if plant.advance(900.0, 1500.0, 1500.0, 1e-3)[0] > 0.0)
        begun.append(1e-3 * steps)
    assert 0.040 <= min(begun) < 0.046
    assert 0.054 < max(begun) <= 0.062


def test_a_delay_that_does_not_fit_is_refused():
    with pytest.raises(PlantError, match=r"delay is out of range: 9.0 \(limit: 0 to 7 frames\)"):
        VehiclePlant(replace(THESIS_VEHICLE, delay_frames=9.0), 0)


def test_random_vehicles_differ_and_are_plausible():
    vehicles = [random_vehicle(seed) for seed in range(200)]
    assert len({vehicle.front.slope_rad_per_unit for vehicle in vehicles}) == 200
    assert vehicles[7] == random_vehicle(7)
    for vehicle in vehicles:
        assert 0.27 <= vehicle.forward.full_mps <= 0.38
        assert vehicle.body.front_axle_m + vehicle.body.rear_axle_m == pytest.approx(0.302)
        for side in (vehicle.forward, vehicle.backward):
            y = 600.0 - side.dead_band
            assert side.unloaded_mps * y / (y + side.knee) > side.full_mps  # full speed is reached within the range


def test_each_steers_and_drives_its_own_way():
    ends = {fresh(seed, make=random_plant).advance(*COMMAND, 3.0) for seed in range(20)}
    assert len(ends) == 20


def test_the_small_plant_steers_in_front_only():
    plant = small_plant(0)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    left = plant.advance(0.3, 0.8, 0.0, 1.0)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    assert plant.advance(0.3, 0.8, 1.0, 1.0) == pytest.approx(left, abs=1e-3)
    assert left[2] > 0.5
    assert SMALL_VEHICLE.command_unit == "normalised"
    plant.reset((0.0, 0.0, 0.0), seed=1)
    assert plant.advance(0.05, 0.8, 0.0, 1.0) == (0.0, 0.0, 0.0)  # within the dead band
