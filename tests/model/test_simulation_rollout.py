"""The general rollout of a vehicle model: beside the fast one, and with effects that only it has."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.effects import ActuationDelay, SpeedLag, SteeringLag, effect_kinds
from agvbench.errors import InputError
from agvbench.model import thesis_vehicle
from agvbench.model.simulation.rollout import general_rollout
from agvbench.model.simulation.simulated_run import SimulatedRun
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Commands
from agvbench.vehicle.geometry import Geometry

TIMES = [np.linspace(-0.5, 9.0, 300), np.linspace(0.0, 4.0, 50)]
INITIAL = [(0.3, 0.1, 1.0), (0.0, 0.0, -2.0)]
COMMANDS = [
    Commands(
        np.array([0.0, 2.1, 5.0]),
        np.array([1100.0, 1900.0, 1500.0]),
        np.array([1300.0, 1750, 1500]),
        np.full(3, 1600.0),
    ),
    Commands(np.array([0.0]), np.array([1800.0]), np.array([1800.0]), np.array([1200.0])),
]


def test_agrees_with_the_fast_rollout():
    model = thesis_vehicle().with_effects(ActuationDelay(0.04), SteeringLag(0.12), SpeedLag(0.25, 0.15))
    general = general_rollout(model, COMMANDS, INITIAL, TIMES)
    for ours, fast in zip(general, model.rollout(COMMANDS, INITIAL, TIMES), strict=True):
        np.testing.assert_allclose(ours, fast, atol=2e-6)


def test_droop_goes_on_between_runs():
    model = thesis_vehicle().with_effects(effect_kinds()["battery_droop"](per_hour=0.2))
    fresh, drained = (general_rollout(model, COMMANDS[1:], INITIAL[1:], TIMES[1:], [h])[0] for h in (0.0, 1.0))
    assert np.hypot(*(drained - fresh)[-1, :2]) > 0.05


def test_no_runs():
    assert general_rollout(thesis_vehicle(), [], np.empty((0, 3)), []) == []


@pytest.mark.parametrize("what", ["parameters", "settled", "initial"])
def test_nan_is_refused(what):
    simulation = Simulation(Geometry(0.2, 0.1), 1500.0, [SimulatedRun(COMMANDS[1], TIMES[1])])
    arrays = {"settled": np.zeros((2, 3)), "parameters": simulation.parameters(), "initial": np.zeros((1, 4))}
    arrays[what].flat[0] = np.nan
    with pytest.raises(InputError, match=rf"^{what}: is not a number: NaN$"):
        simulation.predict(**arrays)


def test_nonsense_ends():
    simulation = Simulation(Geometry(0.2, 0.1), 1500.0, [SimulatedRun(COMMANDS[1], TIMES[1])])
    settled = np.array([[0.0, 0.0, 0.0], [np.pi / 2, -np.pi / 2, 0.3]])
    parameters = simulation.parameters([SteeringLag(1e-12), SpeedLag(1e-300, 0.0)])
    assert simulation.predict(settled, parameters, np.zeros((1, 4))).shape == (50, 3)


def test_a_model_with_any_effect_can_be_rolled_out():
    droop = effect_kinds()["battery_droop"](per_hour=0.2)
    model = thesis_vehicle().with_effects(SteeringLag(0.12), droop)
    started_h = [0.5, 1.0]
    expected = general_rollout(model, COMMANDS, INITIAL, TIMES, started_h)
    for ours, theirs in zip(model.rollout(COMMANDS, INITIAL, TIMES, started_h), expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
