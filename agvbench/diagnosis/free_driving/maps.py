"""Static maps of free driving: few free values over the range of the commands, and where a fit starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.calibration.measurement.windows import held_command
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps, nodal_maps
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import axle_angles

NODES = ((9, 6), (13, 10), (19, 15))
"""Free values of steering and drive maps over the range of their commands, where those take many levels."""

_MANY_LEVELS = 12
_LATE_S = 0.15
_STIFFNESS = 0.3
_MIN_SPEED_MPS = 0.05


def smooth_maps(runs: Sequence[Run], neutral: float, steering: int, drive: int) -> NodalMaps:
    """Return nodal maps with a node for every level, or so many evenly spaced nodes where there are many levels.

    Even spacing, not quantiles: another day's driving may dwell where this one only passed.
    """
    nodes = dict(nodal_maps(runs, neutral).nodes)
    for role in ROLES:
        commanded = np.concatenate([getattr(run.commands, role) for run in runs])
        if role == "drive":
            commanded = commanded[commanded != neutral]
        if len(np.unique(commanded)) > _MANY_LEVELS:
            nodes[role] = _even(commanded, drive if role == "drive" else steering, neutral, role)
    return NodalMaps(nodes, neutral)


def _even(commanded: Floats, count: int, neutral: float, role: str) -> Floats:
    if role != "drive":
        return np.linspace(commanded.min(), commanded.max(), count)
    # Each direction has nodes of its own: between them lies neutral, where the drive stands.
    sides = [commanded[commanded < neutral], commanded[commanded > neutral]]
    return np.concatenate([_side(side, count, neutral) for side in sides if len(side)])


def _side(commanded: Floats, count: int, neutral: float) -> Floats:
    """Return nodes from the command that is passed on the way to driving to the largest."""
    away = np.abs(commanded - neutral)
    low, high = np.quantile(away, 0.02), away.max()
    return np.sort(neutral + np.sign(commanded[0] - neutral) * np.linspace(low, high, count))


def start_values_of_windows(maps: NodalMaps, readings: Readings, geometry: Geometry) -> Floats:
    """Return values to start a fit from: the motion between samples, inverted to axle angles and speed.

    Each is set against the command of a little earlier, since vehicles follow late; a stiff curve is laid through them.
    """
    time = np.column_stack([readings.begins_s, readings.t_s])
    poses = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    dt = np.diff(time, axis=1)
    step, turn = np.diff(poses[..., :2], axis=1), np.diff(poses[..., 2], axis=1)
    middle = poses[:, :-1, 2] + 0.5 * turn
    # The chord of an arc is shorter than the arc.
    per_s = 1.0 / (np.sinc(0.5 * turn / np.pi) * dt)
    forward = (np.cos(middle) * step[..., 0] + np.sin(middle) * step[..., 1]) * per_s
    left = (np.cos(middle) * step[..., 1] - np.sin(middle) * step[..., 0]) * per_s
    front, rear = axle_angles(forward, left, turn / dt, geometry)
    value = {"front": front, "rear": rear, "drive": 2.0 * forward / (np.cos(front) + np.cos(rear))}
    when = 0.5 * (time[:, 1:] + time[:, :-1]) - _LATE_S
    moving = np.isfinite(front + rear) & (np.abs(forward) > _MIN_SPEED_MPS)
    out = []
    for role in ROLES:
        commanded = np.array([held_command(run.commands, role, t) for run, t in zip(readings.runs, when, strict=True)])
        use = moving & ((commanded != maps.neutral) if role == "drive" else True)
        out.append(_stiff(maps.nodes[role], maps.weights(role, commanded[use]), value[role][use]))
    return np.concatenate(out)


def _stiff(nodes: Floats, weights: Floats, value: Floats) -> Floats:
    """Return node values of a curve through `value`, robustly, stiff where there are few."""
    bends = np.diff(np.eye(len(nodes)), 2, axis=0) if len(nodes) > 2 else np.empty((0, len(nodes)))
    trust: Floats = np.ones(len(value))
    found: Floats = np.zeros(len(nodes))
    for _ in range(5):
        matrix = weights.T @ (weights * trust[:, None])
        stiff = _STIFFNESS * np.mean(np.diagonal(matrix)) * bends.T @ bends
        # Where nothing was driven, the line through neighbours, and zero without any.
        found = np.asarray(np.linalg.solve(matrix + stiff + 1e-6 * np.eye(len(nodes)), weights.T @ (trust * value)))
        off = np.abs(value - weights @ found)
        trust = np.asarray(1.0 / np.maximum(off, 1e-3 + np.median(off)))
    return found
