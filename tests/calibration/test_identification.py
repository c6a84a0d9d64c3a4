"""Parameters and initial poses by maximum likelihood, on paths that a few lines of their own drove."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agvbench.calibration.identification import PoseNoise, identify
from agvbench.errors import FitError, InputError
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

GEOMETRY = Geometry(0.181, 0.121)
NOISE = PoseNoise(3e-4, 1e-3)
LAG_S, LOSS = 0.15, 0.05
RATE_HZ = 60.0
FRAMES_S = np.arange(0.0, 6.0, 1.0 / RATE_HZ)


def front_rad(command):
    return -0.0015 * (np.asarray(command) - 1500.0)


def speed_mps(command):
    return np.where(np.asarray(command) == 1500.0, 0.0, 0.3)


def commands(rng):
    t = np.array([0.0, 0.5, 2.0, 3.5, 5.0])
    front = 1500.0 + rng.uniform(-300.0, 300.0, 5)
    return Commands(t, np.array([1500.0, 900.0, 900.0, 900.0, 1500.0]), front, np.full(5, 1500.0))


def driven(told, start):
    """Integrate front steering with a first order lag and a loss in corners, in steps of 0.25 ms."""
    step, (x, y, heading), delta, out = 2.5e-4, start, 0.0, []
    times = []
    for k in range(round(FRAMES_S[-1] / step) + 2):
        t = k * step
        row = int(np.searchsorted(told.t_s, t + 1e-12, side="right")) - 1
        if len(times) < len(FRAMES_S) and t >= FRAMES_S[len(times)] - step / 2.0:
            times.append(t)
            out.append((x, y, heading))
        goal = float(front_rad(told.front[row]))
        middle = goal + (delta - goal) * math.exp(-step / 2.0 / LAG_S)
        delta = goal + (delta - goal) * math.exp(-step / LAG_S)
        v = float(speed_mps(told.drive[row])) * (1.0 - LOSS * abs(math.tan(middle)))
        forward = v * (math.cos(middle) + 1.0) / 2.0
        beta = math.atan(GEOMETRY.rear_axle_m * math.tan(middle) / GEOMETRY.wheelbase_m)
        yaw = forward * math.tan(middle) / GEOMETRY.wheelbase_m
        half = heading + 0.5 * yaw * step
        x += forward / math.cos(beta) * math.cos(half + beta) * step
        y += forward / math.cos(beta) * math.sin(half + beta) * step
        heading += yaw * step
    return np.array(out)


@pytest.fixture(scope="module")
def campaign():
    rng = np.random.default_rng(4)
    told = [commands(rng) for _ in range(6)]
    starts = [(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0)) for _ in told]
    simulation = Simulation(GEOMETRY, NEUTRAL, [SimulatedRun(c, FRAMES_S) for c in told])
    settled = simulation.settled(front_rad, lambda c: np.zeros(len(c)), speed_mps)
    true = np.concatenate([driven(c, s) for c, s in zip(told, starts, strict=True)])
    return simulation, settled, true, np.array(starts)


def noisy(true, seed):
    rng = np.random.default_rng(seed)
    return true + np.array([3e-4, 3e-4, 1e-3]) * rng.standard_normal(true.shape)


def test_parameters_and_poses_come_back_within_their_errors(campaign):
    simulation, settled, true, starts = campaign
    errors = []
    for seed in range(12):
        found = identify(
            simulation, settled, noisy(true, seed), NOISE, effects=["steering_lag", "cornering_speed_loss"]
        )
        errors.append((found.values - [LOSS, LAG_S]) / found.stderr)
    assert found.names == ("cornering_speed_loss.loss", "steering_lag.time_constant_s")
    # Mean square of 24 standard normal numbers: beyond 2.0 in fewer than 3 of 1000 draws.
    assert np.mean(np.square(errors)) < 2.0
    np.testing.assert_allclose(found.initial, starts, atol=1.5e-3)
    degrees = 3 * found.frames - 2 - found.initial.size
    assert abs(found.chi_squared / degrees - 1.0) < 0.08


def test_lost_frames_and_turns_of_the_heading_do_not_matter(campaign):
    simulation, settled, true, _ = campaign
    whole = noisy(true, 3)
    effects = ["steering_lag", "cornering_speed_loss"]
    plain = identify(simulation, settled, whole, NOISE, effects=effects)
    turned = whole.copy()
    turned[::3, 2] += 2.0 * np.pi
    again = identify(simulation, settled, turned, NOISE, effects=effects)
    np.testing.assert_allclose(again.values, plain.values, rtol=1e-6)
    lost = whole.copy()
    lost[5::4] = np.nan
    fewer = identify(simulation, settled, lost, NOISE, effects=effects)
    assert fewer.frames < plain.frames
    assert np.all(np.abs(fewer.values - plain.values) < 3.0 * plain.stderr)
    assert np.all(fewer.stderr > plain.stderr)


def test_what_the_runs_cannot_tell_is_refused(campaign):
    simulation, settled, true, _ = campaign
    with pytest.raises(FitError, match=r"changes nothing|do not tell"):  # nothing drives backward
        identify(simulation, settled, noisy(true, 1), NOISE, effects=["reverse_steering_gain"])
    with pytest.raises(InputError, match="no such effect"):
        identify(simulation, settled, true, NOISE, effects=["gremlins"])
    with pytest.raises(InputError, match="does not fit"):
        identify(simulation, settled, true[:-1], NOISE, effects=["steering_lag"])
    blind = true.copy()
    blind[: len(FRAMES_S)] = np.nan
    with pytest.raises(InputError, match="two frames"):
        identify(simulation, settled, blind, NOISE, effects=["steering_lag"])
    with pytest.raises(InputError, match="greater than zero"):
        PoseNoise(0.0, 1.0)
