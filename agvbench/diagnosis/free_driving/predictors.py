"""What a model of free driving is compared with: each predictor gets the same pose and speed to start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.effects import Effect
from agvbench.model import VehicleModel
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.signals import robust_std
from agvbench.types import Floats


def constant_velocity(readings: Readings) -> Floats:
    """Return poses (W, K, 3) of arcs: the velocity and yaw rate of the last 0.1 s go on."""
    ahead, left, yaw = (column[:, None] for column in _initial_states(readings).constant_velocity.T)
    time = readings.t_s - readings.begins_s[:, None]
    half = 0.5 * yaw * time
    chord = time * np.sinc(half / np.pi)
    heading = readings.start[:, 2, None] + half
    c, s = np.cos(heading), np.sin(heading)
    x = readings.start[:, 0, None] + chord * (c * ahead - s * left)
    y = readings.start[:, 1, None] + chord * (s * ahead + c * left)
    return np.stack([x, y, heading + half], axis=-1)


def speed_held(batch: Batch, parameters: Floats) -> Floats:
    """Return poses (W, K, 3) of the static maps' steering at the speed that was measured at the beginning."""
    predictor = Predictor(batch)
    static = parameters[: predictor.maps.size]
    settled, initial = predictor.settled(static)
    front, rear = settled[:, 0], settled[:, 1]
    ahead = _initial_states(batch.readings).speed_mps[batch.base.row_runs]
    settled[:, 2] = 2.0 * ahead / (np.cos(front) + np.cos(rear))
    poses = batch.base.predict(settled, batch.base.nulls, initial)
    return poses.reshape(len(batch.readings), -1, 3)


def by_speed_error(predictor: Predictor, parameters: Floats) -> Floats:
    """Return by how much predicted poses (W, K, 3) change with a standard error of the speed at the beginning."""
    before = predictor.predict(parameters)
    initial_states = _initial_states(predictor.readings)
    faster = replace(initial_states, speed_mps=initial_states.speed_mps + initial_states.speed_stderr)
    perturbed = Predictor(predictor.batch, predictor.effects)
    perturbed.readings = replace(predictor.readings, initial_states=faster)
    return perturbed.predict(parameters) - before


def prior_model(vehicle: VehicleModel, readings: Readings, kinds: Sequence[type[Effect]]) -> Floats:
    """Return poses (W, K, 3) that a vehicle model predicts; `kinds` are its effects beyond the library's."""
    initial_states = _initial_states(readings)
    runs = [
        SimulatedRun(run.commands, t, float(h), begins_s=float(b))
        for run, t, h, b in zip(readings.runs, readings.t_s, readings.started_h, initial_states.t_s, strict=True)
    ]
    simulation = Simulation(vehicle.geometry, vehicle.neutral, runs, kinds=kinds)
    settled = simulation.settled(vehicle.front, vehicle.rear, vehicle.drive)
    initial = np.column_stack([readings.start, initial_states.speed_mps])
    poses = simulation.predict(settled, simulation.parameters([e for e in vehicle.effects if not e.is_null]), initial)
    return poses.reshape(len(readings), -1, 3)


def nodal_deviation(predictor: Predictor, parameters: Floats) -> float:
    """Return the deviation of the logarithm of speed, within a session, from what commands have made it.

    Beyond twice that, the speed at the beginning of a window says that the drive runs at another level.
    """
    initial_states, batch = _initial_states(predictor.readings), predictor.batch
    shortly = [
        SimulatedRun(run.commands, np.array([b + _SHORTLY_S]), float(h), begins_s=float(b))
        for run, h, b in zip(predictor.readings.runs, predictor.readings.started_h, initial_states.t_s, strict=True)
    ]
    settled, initial = predictor.settled(parameters)
    initial[:, 3] = np.nan
    simulation = Simulation(batch.geometry, batch.maps.neutral, shortly, kinds=batch.kinds)
    moved = simulation.predict(settled, predictor.all_parameters(parameters), initial) - initial[:, :3]
    predicted = (np.cos(initial[:, 2]) * moved[:, 0] + np.sin(initial[:, 2]) * moved[:, 1]) / _SHORTLY_S
    use = (
        (np.abs(predicted) > _SLOW_MPS)
        & (predicted * initial_states.speed_mps > 0.0)
        & (np.abs(initial_states.speed_mps) > _SLOW_MPS)
    )
    off = np.log(np.abs(initial_states.speed_mps[use]) / np.abs(predicted[use]))
    session = initial_states.session[use]
    for name in np.unique(session):
        off[session == name] -= np.median(off[session == name])
    return max(_MIN_DEVIATION, 2.0 * robust_std(off)) if len(off) else _MIN_DEVIATION


def autocorrelation_time(fitted: Fit) -> float:
    """Return how many windows count as one, from the correlation of their neighbours' residuals.

    One, and twice the correlation of a window's residuals with those of the next ones in its stretch, as far as that is
    positive (the variance of a mean of a stationary sequence).
    """
    group = fitted.predictor.readings.group
    e = np.nan_to_num(fitted.residual[:, -1])
    e = e / np.maximum(np.median(np.abs(e), axis=0), 1e-9)
    e = e / np.sqrt(1.0 + np.sum(e * e, axis=1, keepdims=True))  # as Student's law weighs them
    total, own = 1.0, float(np.mean(np.sum(e * e, axis=1)))
    for k in range(1, _MAX_LAG + 1):
        alike = group[k:] == group[:-k]
        if np.count_nonzero(alike) < _MIN_PAIRS:
            break
        correlation = float(np.mean(np.sum(e[k:] * e[:-k], axis=1)[alike])) / own
        if correlation <= 0.0:
            break
        total += 2.0 * correlation
    return total


_MAX_LAG, _MIN_PAIRS = 10, 10
_SHORTLY_S = 0.01
_SLOW_MPS = 0.05
_MIN_DEVIATION = 0.05
