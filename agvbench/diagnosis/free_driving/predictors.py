"""Baselines for models of free driving: all start from the same initial pose and speed."""

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
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Floats
from agvbench.vehicle.kinematics import wheel_speed


def constant_velocity(readings: Readings) -> Floats:
    """Return poses (W, K, 3) of the constant-velocity baseline: arcs with velocity and yaw rate of the last 0.1 s."""
    longitudinal, lateral, yaw = (column[:, None] for column in _initial_states(readings).constant_velocity.T)
    time = readings.t_s - readings.begins_s[:, None]
    half = 0.5 * yaw * time
    chord = time * np.sinc(half / np.pi)
    heading = readings.start[:, 2, None] + half
    c, s = np.cos(heading), np.sin(heading)
    x = readings.start[:, 0, None] + chord * (c * longitudinal - s * lateral)
    y = readings.start[:, 1, None] + chord * (s * longitudinal + c * lateral)
    return np.stack([x, y, heading + half], axis=-1)


def speed_held(batch: Batch, parameters: Floats) -> Floats:
    """Return poses (W, K, 3) with the static maps' steering and the initial speed held constant."""
    predictor = Predictor(batch)
    static = parameters[: predictor.maps.size]
    settled, initial = predictor.settled(static)
    front, rear = settled[:, 0], settled[:, 1]
    speed = _initial_states(batch.readings).speed_mps[batch.base.row_runs]
    settled[:, 2] = wheel_speed(speed, front, rear, batch.geometry)
    poses = batch.base.predict(settled, batch.base.nulls, initial)
    return poses.reshape(len(batch.readings), -1, 3)


def change_by_speed_error(predictor: Predictor, parameters: Floats) -> Floats:
    """Return the change of predicted poses (W, K, 3) by one standard error of the initial speed."""
    before = predictor.predict(parameters)
    initial_states = _initial_states(predictor.readings)
    faster = replace(initial_states, speed_mps=initial_states.speed_mps + initial_states.speed_stderr)
    perturbed = Predictor(predictor.batch, predictor.effects)
    perturbed.readings = replace(predictor.readings, initial_states=faster)
    return perturbed.predict(parameters) - before


def prior_model(vehicle: VehicleModel, readings: Readings, kinds: Sequence[type[Effect]]) -> Floats:
    """Return poses (W, K, 3) that a vehicle model predicts; `kinds` are effects outside the library."""
    initial_states = _initial_states(readings)
    simulation = Simulation(vehicle.geometry, vehicle.neutral, readings.simulated(), kinds=kinds)
    settled = simulation.settled(vehicle.front, vehicle.rear, vehicle.drive)
    initial = np.column_stack([readings.start, initial_states.speed_mps])
    poses = simulation.predict(settled, simulation.parameters([e for e in vehicle.effects if not e.is_null]), initial)
    return poses.reshape(len(readings), -1, 3)


def autocorrelation_time(fitted: Fit) -> float:
    """Return the number of windows that are worth one independent window.

    It is one plus twice the sum of the autocorrelations of residuals within a block, as long as they are positive (the
    variance of the mean of a stationary sequence).
    """
    group = fitted.predictor.readings.group
    e = np.nan_to_num(fitted.residual[:, -1])
    e = e / np.maximum(np.median(np.abs(e), axis=0), 1e-9)
    e = e / np.sqrt(1.0 + np.sum(e * e, axis=1, keepdims=True))  # with the weights of Student's t
    total, variance = 1.0, float(np.mean(np.sum(e * e, axis=1)))
    for k in range(1, _MAX_LAG + 1):
        same_block = group[k:] == group[:-k]
        if np.count_nonzero(same_block) < _MIN_PAIRS:
            break
        correlation = float(np.mean(np.sum(e[k:] * e[:-k], axis=1)[same_block])) / variance
        if correlation <= 0.0:
            break
        total += 2.0 * correlation
    return total


_MAX_LAG, _MIN_PAIRS = 10, 10
