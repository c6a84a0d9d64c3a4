"""From motions to commands and back: plans pass through, what is out of reach is clipped."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.control import Actuation, Motion, Reference
from agvbench.model import example_names
from agvbench.model.examples import example_vehicle
from agvbench.model.nominal import nominal_model
from agvbench.planning import load_trajectory, plan, steered
from agvbench.types import Command
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import body_velocity
from agvbench.vehicle.maps import MonotoneTable

GEOMETRY = Geometry(front_axle_m=0.181, rear_axle_m=0.121)


@pytest.mark.parametrize("vehicle", example_names())
@pytest.mark.parametrize("name", ["5", "8", "figure_eight", "s_curve", "garage"])
def test_the_motions_of_a_plan_are_its_commands(vehicle, name):
    model = example_vehicle(vehicle)
    made = plan(steered(load_trajectory(name), "", model), model)
    reference = Reference(made, model)
    for row, t_s in enumerate(made.commands.t_s):
        motion = reference.feed_forward(float(t_s))
        command = reference.actuation.command(motion)
        assert command == pytest.approx(made.commands.at(row), abs=1e-6)
        assert reference.planned(float(t_s)) == made.commands.at(row)
    assert reference.feed_forward(1e6).speed_mps == 0.0


@given(st.floats(-0.3, 0.3), st.floats(-1.2, 1.2), st.sampled_from(["abeam", "front", "opposite"]))
def test_the_reference_point_moves_along_the_heading_on_the_curvature(speed, curvature, steering):
    model = example_vehicle("thesis")
    actuation = Actuation(model, steering)
    command = actuation.command(Motion(speed, curvature))
    front, rear = (float(angle) for angle in model.axle_angles(command.front, command.rear))
    forward, left, turn = (float(v) for v in body_velocity(front, rear, 1.0, 1.0, model.geometry))
    assert turn / forward == pytest.approx(curvature, abs=1e-6)
    assert left + actuation.ahead_m * turn == pytest.approx(0.0, abs=1e-6)


def test_a_crab_motion_turns_both_axles_alike():
    model = example_vehicle("thesis")
    command = Actuation(model, "crab").command(Motion(0.2, 0.0, math.radians(20.0)))
    assert np.degrees(model.axle_angles(command.front, command.rear)) == pytest.approx([20.0, 20.0])


numbers = st.floats(-1e12, 1e12)


@given(numbers, numbers, st.floats(-3.0, 3.0), st.sampled_from(example_names()))
def test_whatever_is_asked_is_clipped_to_the_vehicle(speed, curvature, crab, name):
    model = example_vehicle(name)
    actuation = Actuation(model, "front")
    limits = {"us": (500.0, 2500.0), "normalised": (-1.0, 1.0), "si": (-20.0, 20.0)}[model.channels.drive.unit]
    commands = actuation.command(Motion(speed, curvature, crab)), actuation.clipped(Command(speed, curvature, crab))
    for command in commands:
        assert all(limits[0] <= value <= limits[1] for value in command)
    low, high = model.drive.command_range
    assert low <= actuation.clipped(Command(speed, 0.0, 0.0)).drive <= high


def test_speed_out_of_reach_keeps_the_turn():
    for name in example_names():
        model = example_vehicle(name)
        actuation = Actuation(model, "front")
        fast, full = (actuation.motion(actuation.command(Motion(v, 0.5))) for v in (100.0, model.drive.output_range[1]))
        assert fast.curvature_per_m == pytest.approx(0.5)
        assert fast.speed_mps == pytest.approx(full.speed_mps)


def test_a_drive_of_which_only_full_speed_is_known_drives_at_full_speed():
    model = nominal_model("new", GEOMETRY, Channels.alike("us"))
    actuation = Actuation(model, "abeam")
    assert actuation.command(Motion(0.1)).drive == 900.0
    assert actuation.command(Motion(-0.1)).drive == 2100.0
    assert actuation.command(Motion(0.0, 0.5)).drive == 1500.0
    assert actuation.command(Motion(0.0, 0.5)).front != 1500.0


def test_a_differential_vehicle_stands_still_at_neutral():
    actuation = Actuation(example_vehicle("differential"), "front")
    assert actuation.command(Motion(0.0, 2.0)) == (0.0, 0.0, 0.0)


def test_a_stop_is_a_stop_where_no_command_near_neutral_was_calibrated():
    drive = MonotoneTable((900.0, 1000.0, 1200.0, 1400.0), (0.32, 0.31, 0.22, 0.12), "linear")
    model = replace(example_vehicle("thesis"), drive=drive)
    actuation = Actuation(model, "front")
    assert actuation.command(Motion(0.0, 0.5)).drive == model.neutral.drive == 1500.0
    assert actuation.clipped(model.neutral) == model.neutral
    assert actuation.clipped(model.neutral._replace(drive=1450.0)).drive == 1400.0
