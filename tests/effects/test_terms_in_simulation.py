"""Discrepancy terms in the simulation, against motion in closed form. Angles are small."""

from __future__ import annotations

import math

import numpy as np

from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.terms import (
    DiscrepancyTerm,
    PauseAtReversal,
    PullOfCable,
    SkewedPicture,
    SpeedAfterDriving,
    SteeringBySideForce,
    SteeringByTurnedHeading,
    SteeringByVelocity,
    SteeringByYawRate,
    SteeringDeadBand,
    SteeringSlip,
)
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)
WHEELBASE_M, SPEED_MPS = 0.4, 0.5


def poses(term: DiscrepancyTerm, rows: np.ndarray, t_s: np.ndarray, fronts: list[float] | None = None) -> np.ndarray:
    """Return poses (K, 3) under a command per second from 0 s on: `rows` (n, 3) of front angle, rear angle and speed.

    The vehicle starts at (0.5, 0.2) with the heading 0. `fronts` (n,) are the commands of the front servo.
    """
    times = np.arange(float(len(rows)))
    commands = Commands(times, np.full(len(rows), 1600.0), np.array(fronts or [1500.0] * len(rows)), times * 0 + 1500.0)
    # The diagnosis compiles this kernel in any case.
    half = 0.5 * WHEELBASE_M
    simulation = Simulation(Geometry(half, half), NEUTRAL, [SimulatedRun(commands, t_s)], kinds=EXTENDED_LIBRARY)
    steady = np.vstack([np.zeros(3), rows])
    return simulation.predict(steady, simulation.parameters([term]), np.array([[0.5, 0.2, 0.0, 0.0]])).reshape(-1, 3)


def constant(front: float, rear: float, speed: float = SPEED_MPS, seconds: int = 2) -> np.ndarray:
    return np.tile([front, rear, speed], (seconds, 1))


def turned_each_second(term: DiscrepancyTerm, rows: np.ndarray, fronts: list[float]) -> np.ndarray:
    """Return by how much the heading changes under each command."""
    headings = poses(term, rows, np.arange(1.0, len(rows) + 1.0), fronts)[:, 2]
    return np.diff(headings, prepend=0.0)


def test_a_servo_ignores_commands_within_its_dead_band() -> None:
    rows = np.array([[0.01, 0.0, 0.5], [0.03, 0.0, 0.5], [0.02, 0.0, 0.5], [0.0, 0.0, 0.5]])
    turned = turned_each_second(SteeringDeadBand(share=1.0, width=45.0), rows, [1540.0, 1600.0, 1560.0, 1500.0])
    np.testing.assert_allclose(turned, np.array([0.0, 0.03, 0.03, 0.0]) * 0.5 / WHEELBASE_M, rtol=2e-3, atol=1e-9)


def test_a_linkage_remains_displaced_to_the_side_on_which_it_slipped() -> None:
    rows = np.tile([0.0, 0.0, 0.5], (5, 1))
    slips = SteeringSlip(slip_rad=0.02, above=150.0, below=100.0)
    turned = turned_each_second(slips, rows, [1600.0, 1700.0, 1550.0, 1380.0, 1500.0])
    np.testing.assert_allclose(turned, np.array([0.0, -1, -1, 1, 1]) * 0.02 * 0.5 / WHEELBASE_M, rtol=2e-3, atol=1e-9)


def test_the_drive_pauses_after_each_reversal() -> None:
    rows = np.array([[0.02, -0.02, speed] for speed in (0.5, -0.5, 0.0, 0.5)])
    t_s = np.array([1.0, 2.0, 3.0, 4.0])
    without, paused = (poses(PauseAtReversal(pause_s=pause), rows, t_s)[:, 2] for pause in (0.0, 0.3))
    lost = 0.3 * 0.5 * 0.04 / WHEELBASE_M
    np.testing.assert_allclose(paused - without, [0.0, lost, lost, 0.0], atol=0.02 * lost)


def test_a_velocity_steers_both_axles() -> None:
    t_s = np.array([2.0])
    forward, backward = (
        poses(SteeringByVelocity(front_rad_s_per_m=0.04, rear_rad_s_per_m=0.01), constant(0.0, 0.0, speed), t_s)[-1, 2]
        for speed in (SPEED_MPS, -SPEED_MPS)
    )
    np.testing.assert_allclose([forward, backward], 2.0 * SPEED_MPS**2 * 0.03 / WHEELBASE_M, rtol=2e-3)


def test_a_gyroscope_reduces_turns_forward_and_increases_them_backward() -> None:
    for speed in (SPEED_MPS, -SPEED_MPS):
        fed_back = SteeringByYawRate(front_s_per_m=0.4, rear_s_per_m=0.0)
        heading = poses(fed_back, constant(0.03, -0.03, speed), np.array([2.0]))[-1, 2]
        np.testing.assert_allclose(heading, 2.0 * speed * 0.06 / WHEELBASE_M / (1.0 + 0.4 * speed), rtol=2e-3)


def test_play_turns_an_axle_to_the_side_of_the_force() -> None:
    for side in (1.0, -1.0):
        play = SteeringBySideForce(rear_rad=0.01, reach=0.003)
        heading = poses(play, constant(0.03 * side, -0.03 * side), np.array([2.0]))[-1, 2]
        np.testing.assert_allclose(heading, side * 2.0 * SPEED_MPS * 0.05 / WHEELBASE_M, rtol=2e-3)


def test_a_cable_that_winds_up_turns_the_axle_back() -> None:
    t_s = np.array([0.5, 1.0, 2.0])
    heading = poses(SteeringByTurnedHeading(front=-0.2), constant(0.02, -0.02), t_s)[:, 2]
    rate = 0.2 * SPEED_MPS / WHEELBASE_M
    np.testing.assert_allclose(heading, 0.04 / 0.2 * -np.expm1(-rate * t_s), rtol=2e-3)


def test_the_vehicle_is_slower_the_more_it_drove() -> None:
    rows = np.vstack([constant(0.02, -0.02), constant(0.02, -0.02, 0.0, 1), constant(0.02, -0.02, seconds=1)])
    heading = poses(SpeedAfterDriving(loss_s_per_m=0.4, time_constant_s=0.8), rows, np.array([2.0, 3.0, 4.0]))[:, 2]
    rate, decay = SPEED_MPS * 0.04 / WHEELBASE_M, math.exp(-1.0 / 0.8)
    # The mean commanded speed grows to its steady state, decays at rest, and grows again.
    most = 0.4 * SPEED_MPS
    first = rate * (2.0 - most * (2.0 - 0.8 * (1.0 - decay**2)))
    left = (1.0 - decay**2) * decay
    second = rate * (1.0 - most * (1.0 - (1.0 - left) * 0.8 * (1.0 - decay)))
    np.testing.assert_allclose(heading, [first, first, first + second], rtol=2e-3)


def test_a_cable_brakes_on_the_way_out_and_helps_on_the_way_in() -> None:
    cable = PullOfCable(per_s=0.5, x_m=0.0, y_m=0.2, slack_m=0.2)
    out, back = (poses(cable, constant(0.0, 0.0, speed), np.array([0.5]))[-1, 0] for speed in (0.5, -0.5))
    # The cable is stretched by u = x − 0.2 m, and u̇ = ±0.5 − 0.5 u.
    np.testing.assert_allclose([out, back], [1.2 - 0.7 * math.exp(-0.25), -0.8 + 1.3 * math.exp(-0.25)], atol=1e-3)


def test_skewed_axes_displace_the_position_and_not_the_heading() -> None:
    x, y, heading = poses(SkewedPicture(skew=0.1, stretch=0.02), constant(0.03, -0.03), np.array([2.0]))[-1]
    true_x, true_y, true_heading = poses(SkewedPicture(), constant(0.03, -0.03), np.array([2.0]))[-1]
    # The start is where the camera reports it.
    start_x = 0.5 - 0.1 * 0.2
    moved_x, moved_y = true_x - 0.5, true_y - 0.2
    np.testing.assert_allclose(y - 0.2, moved_y, atol=1e-9)
    np.testing.assert_allclose(heading, true_heading, atol=1e-9)
    np.testing.assert_allclose(x, 1.02 * (start_x / 1.02 + moved_x) + 0.1 * (0.2 + moved_y), atol=1e-9)
