"""The lag of the motion filter is compensated where a drive begins to accelerate."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.diagnosis.data.motion_filter import MotionFilter
from agvbench.effects import effect_kinds
from agvbench.model import example_vehicle
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Commands

LAG_S, HORIZON_S = 0.3, 1.0
CHANGES_S = np.array([0.0, 2.0, 3.1, 4.5, 5.0, 7.0, 7.4])
SPEEDS_MPS = np.array([0.5, 1.2, 0.4, 0.9, -0.6, 0.3, 1.1])
LAG = effect_kinds()["speed_lag"](accelerate_s=LAG_S, brake_s=LAG_S)


def driven(t_s: np.ndarray) -> np.ndarray:
    """Return positions and speeds (n, 2) of a vehicle that had its first speed long before, in closed form."""
    place, speed, out = 0.0, SPEEDS_MPS[0], np.empty((len(t_s), 2))
    for begin, until, aim in zip(CHANGES_S, [*CHANGES_S[1:], np.inf], SPEEDS_MPS, strict=True):
        own = (t_s >= begin) & (t_s < until)
        left = np.exp((begin - t_s[own]) / LAG_S)
        out[own, 0] = place + aim * (t_s[own] - begin) + (speed - aim) * LAG_S * (1.0 - left)
        out[own, 1] = aim + (speed - aim) * left
        if until < np.inf:
            last = np.exp((begin - until) / LAG_S)
            place += aim * (until - begin) + (speed - aim) * LAG_S * (1.0 - last)
            speed = aim + (speed - aim) * last
    return out


def predicted(begins_s: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """Return where windows end (n,), along the floor's x axis."""
    held_s = np.r_[-1e3, CHANGES_S[1:]]
    commands = Commands(held_s, 1600.0 + 0.0 * held_s, *np.full((2, len(held_s)), 1500.0))
    runs = [SimulatedRun(commands, np.array([t + HORIZON_S]), begins_s=float(t)) for t in begins_s]
    vehicle = example_vehicle("thesis")
    simulation = Simulation(vehicle.geometry, vehicle.neutral, runs)
    of_run = np.r_[0.0, SPEEDS_MPS]
    settled = np.zeros((len(of_run) * len(runs), 3))
    settled[:, 2] = np.tile(of_run, len(runs))
    return simulation.predict(settled, simulation.parameters([LAG]), initial)[:, 0]


@pytest.mark.parametrize(
    ("rate", "noise_m", "jerk"), [(20.0, 0.015, 1.0), (30.0, 1.5e-3, 20.0), (100.0, 1e-4, 10.0), (10.0, 1e-4, 30.0)]
)
def test_the_lag_of_the_filter_is_compensated(rate, noise_m, jerk):
    t_s = np.arange(-8.0, 8.5, 1.0 / rate)
    truth = driven(np.maximum(t_s, 0.0))
    truth[:, 0] += SPEEDS_MPS[0] * np.minimum(t_s, 0.0)
    found = MotionFilter(np.array([noise_m, 1e-3]), np.array([jerk, 1.0]))
    states = found.states(t_s, np.column_stack([truth[:, 0], 0.0 * t_s, 0.0 * t_s]))
    begins = np.flatnonzero((t_s > 0.5) & (t_s < 8.0 - HORIZON_S))
    ends = driven(t_s[begins] + HORIZON_S)[:, 0]
    initial = np.zeros((len(begins), 8))
    initial[:, 0], initial[:, 3] = states.pose[begins, 0], states.velocity[begins, 0]
    errors = []
    for bandwidth in (np.inf, found.bandwidth(1.0 / rate)):
        initial[:, 7] = bandwidth
        errors.append(np.sqrt(np.mean((predicted(t_s[begins], initial) - ends) ** 2)))
    assert errors[1] < 0.6 * errors[0]
