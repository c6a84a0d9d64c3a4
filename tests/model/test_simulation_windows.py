"""Windows of driving: the speed that is seen at their beginning, and the level of the drive that it tells."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

T = np.arange(2.1, 4.0, 0.1)
BEGINS_S = 2.0


def window(front: float = 0.0) -> tuple[Simulation, np.ndarray]:
    """Return a window at 2 s into a drive at one command, and its settled rows."""
    one = np.array([-100.0])
    run = SimulatedRun(Commands(one, one * 0 + 1000.0, one * 0 + 1500, one * 0 + 1500), T, begins_s=BEGINS_S)
    return Simulation(Geometry(0.2, 0.1), NEUTRAL, [run]), np.array([[front, 0.0, 0.0], [front, 0.0, 0.4]])


def parameters(simulation: Simulation, **values: float) -> np.ndarray:
    out = simulation.nulls.copy()
    for name, value in values.items():
        out[simulation.parameter_names.index(name.replace("__", "."))] = value
    return out


def test_the_speed_at_the_beginning_is_the_bodys_whatever_cornering_takes():
    simulation, settled = window(front=0.4)
    slow = parameters(simulation, cornering_speed_loss__loss=0.5, speed_lag__accelerate_s=5.0, speed_lag__brake_s=5.0)
    poses = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.3]]))
    ahead = np.cos(poses[0, 2] / 2) * poses[0, 0] + np.sin(poses[0, 2] / 2) * poses[0, 1]
    assert ahead == pytest.approx(0.03, rel=0.02)


@pytest.mark.parametrize(("seen", "scatter", "expected"), [(0.8, np.inf, 0.4), (0.8, 1e-6, 0.8), (0.4, 0.1, 0.4)])
def test_another_level_is_believed_only_beyond_scatter(seen, scatter, expected):
    simulation, settled = window()
    start = np.array([[0.0, 0.0, 0.0, seen]])
    poses = simulation.predict(settled, simulation.nulls.copy(), start, nodal_deviation=scatter)
    np.testing.assert_allclose(poses[:, 0], expected * (T - BEGINS_S), atol=1e-6)


def test_a_speed_that_has_not_lasted_tells_no_level():
    simulation, settled = window()
    start = np.array([[0.0, 0.0, 0.0, 0.8, 0.4]])
    poses = simulation.predict(settled, simulation.nulls.copy(), start, nodal_deviation=0.1)
    np.testing.assert_allclose(poses[:, 0], 0.4 * (T - BEGINS_S), atol=1e-6)


TWO_AXLES, DIFFERENTIAL = Geometry(0.2, 0.1), Geometry(0.0, 0.1, kinematics="differential")


@pytest.mark.parametrize(("geometry", "turn"), [(TWO_AXLES, 0.25), (DIFFERENTIAL, -0.3)])
def test_a_window_begins_with_the_yaw_rate_that_was_seen(geometry, turn):
    one = np.array([-100.0])
    run = SimulatedRun(Commands(one, one * 0 + 1000.0, one * 0 + 1500, one * 0 + 1500), T, begins_s=BEGINS_S)
    simulation = Simulation(geometry, NEUTRAL, [run])
    settled = np.array([[0.1, 0.0, 0.0], [0.1, 0.0, 0.4]])
    slow = parameters(simulation, steering_lag__time_constant_s=1e4)
    poses = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.4, 0.4, turn, 1.0]]))
    np.testing.assert_allclose(poses[:, 2], turn * (T - BEGINS_S), rtol=5e-3)
    # Without a weight the vehicle turns as its commands before the window made it turn.
    held = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.4, 0.4, turn, 0.0]]))
    before = 0.1 if geometry.is_differential else 0.4 * np.tan(0.1) / 0.3
    np.testing.assert_allclose(held[:, 2], before * (T - BEGINS_S), rtol=0.02)
    between = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.4, 0.4, turn, 0.5]]))
    np.testing.assert_allclose(between[:, 2], 0.5 * (poses[:, 2] + held[:, 2]), atol=0.02)


def test_a_yaw_rate_that_steering_cannot_change_leaves_the_axle():
    simulation, settled = window(front=0.2)
    slow = parameters(simulation, steering_lag__time_constant_s=1e4)
    standing = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0]]))
    assert np.isfinite(standing).all()
    usual = simulation.predict(settled, slow, np.array([[0.0, 0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(standing, usual, atol=1e-9)
