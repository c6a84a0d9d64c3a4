"""Every effect is recovered from a vehicle that shares no code with it, and told apart from the others.

The vehicle is a hidden plant: its own equations and integrator, its maps known here by their formulas. An effect that
`agvbench.effects` exports belongs to the library and has a mechanism there (`agvbench/simulator/hidden`): without an
independent vehicle nobody knows whether its equation is right. Any other effect is compared with an independent
integration of its own hooks (`test_effects_plain.py`), and is skipped here.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import least_squares

import agvbench.effects as library
from agvbench.effects import effect_kinds
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.simulator.hidden import CATALOGUE, HiddenPlant
from agvbench.simulator.hidden.constants import BASE
from agvbench.simulator.hidden.plant import TURNAROUND_S
from agvbench.simulator.hidden.reference_drives import path, reference_drives
from agvbench.simulator.hidden.sampling import make_hidden_plant, vehicle_of
from agvbench.types import Command, Commands
from agvbench.vehicle.geometry import Geometry

NEUTRAL = Command(1500.0, 1500.0, 1500.0)

SEED = 7
NOISE = np.array([2e-4, 2e-4, 1e-3])
LEVER_M = 0.15
KINDS = effect_kinds()
WITHOUT_MECHANISM = {
    name for name, kind in KINDS.items() if name not in CATALOGUE and kind.__name__ not in library.__all__
}
NO_MECHANISM = (
    "no mechanism in the hidden plants; to make it part of the blind trials, add its recipe to "
    "agvbench/simulator/hidden/catalogue.py, its constants with their nulls to constants.py, and its equation to "
    "_actuators.py, _body.py or _kernel.py"
)
# What maps with values of their own take up leaves nothing to tell apart.
IN_THE_MAPS = {"steering_saturation", "drive_dead_band"}
TOLD_APART = 0.1
"""Share of an effect's own signature, the maps refitted, that the other may not imitate."""


def settled(simulation, constants):
    """Return what the plant's maps say of every row, by formulas of this test."""
    c = BASE | constants

    def steer(role, command):
        angle = c[f"{role}_offset"] + c[f"{role}_slope"] * (command - c["neutral"])
        return np.clip(angle, c[f"{role}_low"], c[f"{role}_high"])

    def speed(command):
        forward = c["neutral"] - command
        gain = np.where(forward > 0.0, c["gain_forward"], c["gain_backward"])
        return np.sign(forward) * gain * np.maximum(np.abs(forward) - c["drive_dead"], 0.0)

    return simulation.settled(lambda u: steer("front", u), lambda u: steer("rear", u), speed)


class Data:
    """What a plant did in the reference drives, and the simulation of the same drives."""

    def __init__(self, name):
        # The base vehicle has the library's dead band already, so that leaving it out of the map is to hide it.
        hides = "nothing" if name == "drive_dead_band" else name
        truth = make_hidden_plant(hides, SEED, floors=0.0).sealed_truth()
        constants = dict(truth.constants)
        self.parameters = {"width": constants["drive_dead"]}
        if hides != "nothing":
            self.parameters = dict(truth.effects[0].parameters)
        plant = HiddenPlant(constants, (0.0, 0.0, 0.0), 0, truth)
        drives = reference_drives(vehicle_of(SEED))
        runs, poses, clock_s = [], [], 0.0
        for drive in drives:
            times = np.concatenate([[0.0], np.cumsum([row[0] for row in drive.rows])])
            columns = np.array(drive.rows)
            commands = Commands(times[:-1], *columns[:, 1:].T.copy())
            poses.append(path(plant, drive))
            runs.append(SimulatedRun(commands, self._times(drive), clock_s / 3600.0))
            clock_s += times[-1] + TURNAROUND_S
        self.starts = np.array([[*drive.start, 0.0, 0.0] for drive in drives])
        self.simulation = Simulation(Geometry(0.181, 0.121), NEUTRAL, runs)
        known = constants | ({"drive_dead": 0.0} if name == "drive_dead_band" else {})
        self.settled = settled(self.simulation, known)
        noise = np.random.default_rng(3).normal(size=(len(self.simulation.predict(*self.at_null())), 3)) * NOISE
        self.poses = np.concatenate(poses) + noise

    @staticmethod
    def _times(drive):
        times, began = [], 0.0
        for duration_s, *_ in drive.rows:
            steps = np.arange(1, int(duration_s / 0.05) + 1) * 0.05
            times += [*(began + steps), began + duration_s]
            began += duration_s
        return np.array(times)

    def at_null(self):
        return self.settled, self.simulation.nulls.copy(), self.starts

    def predict(self, name, values):
        parameters = self.simulation.nulls.copy()
        parameters[self.simulation.indices(name)] = values
        return self.simulation.predict(self.settled, parameters, self.starts)


@pytest.fixture(scope="module")
def quiet():
    return Data("nothing")


def test_the_vehicle_without_effects_is_predicted_to_the_noise(quiet):
    residual = (quiet.poses - quiet.simulation.predict(*quiet.at_null())) / NOISE
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("name", KINDS)
def test_a_planted_value_is_recovered(name):
    if KINDS[name].needs_differential:
        pytest.skip(f"{name} is planted in tests/diagnosis/test_differential.py: these plants have two axles")
    if name in WITHOUT_MECHANISM:
        pytest.skip(f"{name} has {NO_MECHANISM}")
    data = Data(name)
    parameters = KINDS[name].parameters()
    truth = np.array([data.parameters[p.name] for p in parameters])
    low, high = (np.array([getattr(p, side) for p in parameters]) for side in ("low", "high"))

    def residual(values):
        return ((data.poses - data.predict(name, values)) / NOISE).ravel()

    scale = [p.scale for p in parameters]
    starts = [
        [direction if p.name == "direction_rad" else sign * p.scale for p in parameters]
        for sign, direction in zip((1.0, -1.0, 1.0, -1.0), (-2.4, -0.8, 0.8, 2.4), strict=True)
    ]
    fits = [
        least_squares(residual, start, bounds=(low, high), x_scale=scale, diff_step=1e-4)
        for start in np.unique(np.clip(starts, low, np.minimum(high, 1e3)), axis=0)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    stderr = np.sqrt(np.diagonal(np.linalg.inv(best.jac.T @ best.jac)))
    turn = np.array([p.name == "direction_rad" for p in parameters])
    off = np.where(turn, np.remainder(best.x - truth + math.pi, math.tau) - math.pi, best.x - truth)
    assert np.all(np.abs(off) < 4.0 * stderr + 2e-3 * np.abs(truth)), (best.x, truth, stderr)
    assert np.sqrt(np.mean(residual(best.x) ** 2)) < 1.1
    assert np.sqrt(np.mean(residual([p.null for p in parameters]) ** 2)) > 2.0


@pytest.fixture(scope="module")
def signatures(quiet):
    """Return by effect what each of its parameters does to the drives (samples, p), the static maps refitted."""
    null = quiet.simulation.predict(*quiet.at_null())
    weight = np.array([1.0, 1.0, LEVER_M])
    maps = np.linalg.qr(np.column_stack(list(map_columns(quiet, null, weight))))[0]
    found = {}
    for name, kind in KINDS.items():
        if name in IN_THE_MAPS:
            continue
        scales = np.array([p.scale for p in kind.parameters()])
        columns = []
        for k, p in enumerate(kind.parameters()):
            own = np.array([p.null for p in kind.parameters()])
            own[k] = p.scale
            if p.name in {"direction_rad", "integral_time_s"}:  # without the first parameter it does nothing
                own[0] = scales[0]
            columns.append(((quiet.predict(name, own) - null) * weight).ravel())
        moved = np.column_stack(columns)
        found[name] = moved - maps @ (maps.T @ moved)
    return found


def map_columns(data, null, weight):
    for column, role in enumerate(("front", "rear", "drive")):
        commands = getattr(data.simulation, role)
        for level in np.unique(commands):
            if role == "drive" and level == 1500.0:
                continue
            moved = data.settled.copy()
            moved[commands == level, column] += 1e-4
            poses = data.simulation.predict(moved, data.simulation.nulls, data.starts)
            yield ((poses - null) * weight).ravel() / 1e-4


def test_effects_are_told_apart_or_declared_rivals(signatures):
    """What of an effect another cannot imitate, with the maps free; who can is named in its ``limits``."""
    undeclared = []
    for one, other in combinations(signatures, 2):
        left = min(imitated(signatures[one], signatures[other]), imitated(signatures[other], signatures[one]))
        declared = other in KINDS[one].limits or one in KINDS[other].limits
        if left < TOLD_APART and not declared:
            undeclared.append((one, other, round(left, 3)))
    assert not undeclared


def imitated(of, by):
    """Return the least share of a parameter's signature that is left when `by` is fitted to it."""
    basis = np.linalg.qr(by)[0]
    left = of - basis @ (basis.T @ of)
    return float(np.min(np.linalg.norm(left, axis=0) / np.maximum(np.linalg.norm(of, axis=0), 1e-12)))
