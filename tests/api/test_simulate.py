"""`agvbench.simulate`: one run of a vehicle with its effects."""

from __future__ import annotations

import numpy as np
import pytest

import agvbench
from agvbench.effects import BatteryDroop, SteeringLag
from agvbench.errors import InputError
from agvbench.model import thesis_vehicle
from agvbench.planning import load_trajectory
from agvbench.types import Commands


@pytest.fixture(scope="module")
def planned():
    return agvbench.plan(load_trajectory("5"), thesis_vehicle())


def test_the_planned_commands_lead_to_the_planned_target(planned):
    poses = agvbench.simulate(thesis_vehicle(), planned.commands, agvbench.Pose(0, 0, 0), [0.0, planned.duration_s])
    assert poses.shape == (2, 3)
    np.testing.assert_allclose(poses[-1], planned.target, atol=1e-6)


def test_a_steering_lag_moves_a_turn_that_begins_while_driving():
    at_once = Commands(*(np.array([value]) for value in (0.0, 900.0, 1300.0, 1700.0)))
    model = thesis_vehicle()
    ideal = agvbench.simulate(model, at_once, (1.0, 2.0, 0.5), [4.0])
    late = agvbench.simulate(model.with_effects(SteeringLag(time_constant_s=0.3)), at_once, (1.0, 2.0, 0.5), [4.0])
    assert 0.01 < np.hypot(*(late - ideal)[0, :2]) < 0.3
    assert late[0, 2] < ideal[0, 2]


def test_hours_since_the_session_began_count_for_a_battery(planned):
    model = thesis_vehicle().with_effects(BatteryDroop(per_hour=0.1))
    fresh, worn = (
        agvbench.simulate(model, planned.commands, (0.0, 0.0, 0.0), [planned.duration_s], started_h=hours)
        for hours in (0.0, 2.0)
    )
    assert worn[0, 2] / fresh[0, 2] == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize("initial", [(0.0, 0.0), [(0.0, 0.0, 0.0)] * 2])
def test_an_initial_pose_has_three_numbers(planned, initial):
    with pytest.raises(InputError, match="initial poses must have shape"):
        agvbench.simulate(thesis_vehicle(), planned.commands, initial, [0.0])
