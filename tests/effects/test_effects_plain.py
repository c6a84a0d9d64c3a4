"""The compiled simulation moves a vehicle as an adaptive integrator does that calls the hooks as plain Python.

The kinematics and the integrator of this file are independent of the simulation; the equation is that of the hook. An
effect that depends on place, heading, distance or time and states no `longest_step_s` fails here.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from agvbench.effects import Effect, effect_kinds
from agvbench.effects import state as s
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

FRONT_M, REAR_M, NEUTRAL, STARTED_H = 0.18, 0.12, 1500.0, 1.0
COMMANDED = {"drive": 1000.0, "front": 1300.0, "rear": 1560.0}
FRAMES_S = np.linspace(0.0, 4.0, 41)
START = np.array([0.5, 0.2, 0.3])
DEPENDS_ON_ANGLES_AND_SPEED_AT_ONCE = {"steer", "drive", "move", "drift"}
KINDS = {
    name: kind for name, kind in effect_kinds().items() if DEPENDS_ON_ANGLES_AND_SPEED_AT_ONCE.issuperset(kind.hooks())
}


def run_hook(effect: Effect, name: str, state: np.ndarray) -> None:
    hook = effect.hooks().get(name)
    if hook is not None:
        hook(state, *effect.values.values())


def rates(time_s: float, place: np.ndarray, effect: Effect, angles: tuple[float, float], speed: float) -> list[float]:
    """Return the rates of x, y, heading and distance under `effect`, axle angles [rad] and drive speed [m/s]."""
    state = np.zeros(s.SIZE)
    state[[s.TIME, s.HOURS]] = time_s, STARTED_H + time_s / 3600.0
    state[[s.X, s.Y, s.HEADING, s.DISTANCE]] = place
    state[[s.DRIVE_COMMAND, s.FRONT_COMMAND, s.REAR_COMMAND]] = np.array([*COMMANDED.values()]) - NEUTRAL
    state[[s.FRONT, s.REAR, s.SPEED]] = state[[s.FRONT_AIM, s.REAR_AIM, s.SPEED_AIM]] = *angles, speed
    run_hook(effect, "steer", state)
    axles = state[[s.FRONT, s.REAR]]
    state[[s.TAN_FRONT, s.TAN_REAR]], state[[s.COS_FRONT, s.COS_REAR]] = np.tan(axles), np.cos(axles)
    state[[s.FRONT_SPEED, s.REAR_SPEED]], state[s.DRAGGED] = speed, 1.0
    run_hook(effect, "drive", state)
    state[s.FORWARD] = np.mean(state[[s.FRONT_SPEED, s.REAR_SPEED]] * np.cos(axles))
    turned, wheelbase_m = state[s.FORWARD] * np.tan(axles), FRONT_M + REAR_M
    state[s.LEFT] = (FRONT_M * turned[1] + REAR_M * turned[0]) / wheelbase_m
    state[s.YAW_RATE] = (turned[0] - turned[1]) / wheelbase_m
    run_hook(effect, "move", state)
    velocity = complex(state[s.FORWARD], state[s.LEFT]) * np.exp(1j * place[2])
    state[[s.X_RATE, s.Y_RATE]] = velocity.real, velocity.imag
    run_hook(effect, "drift", state)
    return [state[s.X_RATE], state[s.Y_RATE], state[s.YAW_RATE], abs(speed)]


@pytest.mark.parametrize("speed", [0.3, -0.3])
@pytest.mark.parametrize("cls", KINDS.values(), ids=KINDS.keys())
def test_the_simulation_is_the_integral_of_the_plain_hooks(cls: type[Effect], speed: float) -> None:
    effect = cls(**{p.name: p.scale for p in cls.parameters()})
    angles = (0.35, -0.1)
    commands = Commands(np.zeros(1), *(np.array([value]) for value in COMMANDED.values()))
    simulation = Simulation(
        Geometry(FRONT_M, REAR_M), Command(NEUTRAL, NEUTRAL, NEUTRAL), [SimulatedRun(commands, FRAMES_S, STARTED_H)]
    )
    settled = np.array([[0.0, 0.0, 0.0], [*angles, speed]])
    simulated = simulation.predict(settled, simulation.parameters([effect]), np.array([[*START, 0.0]]))
    span, start = (0.0, FRAMES_S[-1]), [*START, 0.0]
    integrated = solve_ivp(rates, span, start, t_eval=FRAMES_S, rtol=1e-9, atol=1e-10, args=(effect, angles, speed))
    # Between two steps the simulation extrapolates the pose on which a hook may depend.
    np.testing.assert_allclose(simulated, integrated.y[:3].T, atol=2e-5 if math.isinf(cls.longest_step_s) else 2e-3)
