"""The eight are what the thesis describes, whatever the code that plans them believes."""

import math
import tomllib

import numpy as np
import pytest

from agvbench.model import nominal_model, thesis_vehicle
from agvbench.planning import list_trajectories, load_trajectory, plan
from agvbench.planning.trajectories.loading import trajectory_files
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry

TARGETS = {  # thesis section 8.2: m, m, degrees
    "1": (2, 0, 0),
    "2": (-2, 0, 0),
    "3": (2, 0, 0),
    "4": (-2, 0, 0),
    "5": (1, 1, 90),
    "6": (1, -1, -90),
    "7": (-1, 1, -90),
    "8": (-1, -1, 90),
}
NOMINAL = nominal_model("agv", Geometry(0.181, 0.121), Channels.alike("us"))


@pytest.mark.parametrize("name", TARGETS)
def test_target_is_the_thesis_target_and_the_plan_leads_there(name):
    x, y, degrees = TARGETS[name]
    for model in (thesis_vehicle(), NOMINAL):
        trajectory = load_trajectory(name)
        if model is NOMINAL and "uncalibrated" not in trajectory.conditions:
            continue
        made = plan(trajectory, model)
        assert made.target == pytest.approx((x, y, math.radians(degrees)), abs=1e-12)
        assert np.allclose(made.expected[-1, 1:], [x, y, math.radians(degrees)], atol=1e-9)


def test_half_speed_is_not_driven_uncalibrated():
    for name in TARGETS:
        assert ("uncalibrated" in load_trajectory(name).conditions) == (name not in "34")


@pytest.mark.parametrize(("name", "sign"), [("1", 1), ("2", -1), ("5", 1), ("6", 1), ("7", -1), ("8", -1)])
def test_uncalibrated_commands_are_full_speed(name, sign):
    commands = plan(load_trajectory(name), NOMINAL).commands
    assert commands.drive.tolist() == [1500.0, 1500.0 - sign * 600.0, 1500.0]


@pytest.mark.parametrize(("name", "left"), [("5", True), ("6", False), ("7", True), ("8", False)])
def test_a_falling_pulse_at_the_front_turns_left(name, left):
    command = plan(load_trajectory(name), NOMINAL).commands.at(0)
    assert (command.front < 1500.0) == left
    assert (command.rear > 1500.0) == left
    # tan δf = lf / R in front; 45° for 600 µs.
    assert abs(1500.0 - command.front) == pytest.approx(math.degrees(math.atan(0.181)) * 600.0 / 45.0)


@pytest.mark.parametrize("trajectory", list_trajectories(), ids=lambda t: t.name)
def test_every_shipped_trajectory_can_be_driven_under_each_of_its_conditions(trajectory):
    from agvbench.planning import Workspace

    for condition in trajectory.conditions:
        model = NOMINAL if condition == "uncalibrated" else thesis_vehicle()
        made = plan(trajectory, model, workspace=Workspace.circle())
        assert made.duration_s > 0.0


@pytest.mark.parametrize("file", trajectory_files(), ids=lambda file: file.stem)
def test_a_shipped_file_is_named_after_its_trajectory_and_says_what_it_is(file):
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    assert file.stem == table["name"] or file.stem.startswith(table["name"] + "_")
    assert table["description"]
