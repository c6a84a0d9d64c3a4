"""Static maps of free driving: few nodes over the range of the commands, and initial nodal values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agvbench.calibration.measurement.windows import held_command
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps, nodal_maps
from agvbench.types import Command, Floats, Run
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import actuator_values

NODES = ((9, 6), (13, 10), (19, 15))
"""Numbers of nodes of steering and drive maps, for commands with many levels."""

_MANY_LEVELS = 12
_TYPICAL_DELAY_S = 0.15
_STIFFNESS = 0.3
_MIN_SPEED_MPS = 0.05


def smooth_maps(
    runs: Sequence[Run],
    neutral: Command,
    steering: int,
    drive: int,
    others: Sequence[Run] = (),
    *,
    is_differential: bool = False,
) -> NodalMaps:
    """Return nodal maps with a node at every level, or with evenly spaced nodes if there are many levels.

    Nodes are evenly spaced and not at quantiles, because driving on another day may use other levels more often. They
    span the commands of the `runs` and those of the `others` in the directions that the `runs` drive.
    """
    found = nodal_maps(runs, neutral, is_differential=is_differential)
    nodes = dict(found.nodes)
    for role in ROLES:
        commanded = np.concatenate([getattr(run.commands, role) for run in runs])
        if not len(nodes[role]):
            continue
        if role in found.zero_at_neutral:
            commanded = commanded[commanded != getattr(neutral, role)]
        if len(np.unique(commanded)) <= _MANY_LEVELS:
            continue
        further = np.concatenate([np.empty(0), *(getattr(run.commands, role) for run in others)])
        commanded = np.concatenate([commanded, _in_driven_directions(further, commanded, role, found)])
        if role not in found.zero_at_neutral:
            nodes[role] = np.linspace(commanded.min(), commanded.max(), steering)
        else:
            count = drive if role == "drive" else (steering + 1) // 2
            nodes[role] = _on_each_side(commanded, count, getattr(neutral, role))
    return replace(found, nodes=nodes)


def _in_driven_directions(further: Floats, commanded: Floats, role: str, maps: NodalMaps) -> Floats:
    """Return the `further` commands to whose side of neutral some were `commanded`; all, if neutral is no zero."""
    if role not in maps.zero_at_neutral:
        return further
    neutral = getattr(maps.neutral, role)
    return further[np.isin(np.sign(further - neutral), np.sign(commanded - neutral))]


def _on_each_side(commanded: Floats, count: int, neutral: float) -> Floats:
    """Return `count` nodes for each direction; the value at neutral, between them, is zero."""
    sides = [commanded[commanded < neutral], commanded[commanded > neutral]]
    return np.concatenate([_side(side, count, neutral) for side in sides if len(side)])


def _side(commanded: Floats, count: int, neutral: float) -> Floats:
    """Return evenly spaced nodes from the 2 % quantile of the distance from neutral to the largest.

    They begin at the smallest distance if nearly all commands are the largest one, and are one if there is no other.
    """
    distance = np.abs(commanded - neutral)
    low, high = np.quantile(distance, 0.02), distance.max()
    low = low if low < high else distance.min()
    return np.unique(neutral + np.sign(commanded[0] - neutral) * np.linspace(low, high, count))


def start_values_of_windows(maps: NodalMaps, readings: Readings, geometry: Geometry) -> Floats:
    """Return initial nodal values: the motion between samples, inverted to axle angles and speed.

    Each value is assigned to the command 0.15 s before, a typical delay, and a stiff curve is fitted to them.
    """
    time = np.column_stack([readings.begins_s, readings.t_s])
    poses = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    # At low frame rates two samples may be one frame, between which there is no motion to see.
    dt = np.diff(time, axis=1)
    dt = np.where(dt > 0.0, dt, np.nan)
    step, turn = np.diff(poses[..., :2], axis=1), np.diff(poses[..., 2], axis=1)
    middle = poses[:, :-1, 2] + 0.5 * turn
    # The chord of an arc is shorter than the arc.
    per_s = 1.0 / (np.sinc(0.5 * turn / np.pi) * dt)
    forward = (np.cos(middle) * step[..., 0] + np.sin(middle) * step[..., 1]) * per_s
    left = (np.cos(middle) * step[..., 1] - np.sin(middle) * step[..., 0]) * per_s
    front, rear, speed = actuator_values(forward, left, turn / dt, geometry)
    value = {"front": front, "rear": rear, "drive": speed}
    when = 0.5 * (time[:, 1:] + time[:, :-1]) - _TYPICAL_DELAY_S
    moving = np.isfinite(front + rear) & ((np.abs(forward) > _MIN_SPEED_MPS) | geometry.is_differential)
    out = []
    for role in ROLES:
        commanded = np.array([held_command(run.commands, role, t) for run, t in zip(readings.runs, when, strict=True)])
        # A command is unknown before the first one of the recording.
        use = moving & np.isfinite(commanded)
        if role in maps.zero_at_neutral:
            use &= commanded != getattr(maps.neutral, role)
        out.append(_smoothed(maps.nodes[role], maps.weights(role, commanded[use]), value[role][use]))
    return np.concatenate(out)


def _smoothed(nodes: Floats, weights: Floats, value: Floats) -> Floats:
    """Return the nodal values of a robust smoothing curve through `value`."""
    if not len(nodes) or not len(value):
        return np.zeros(len(nodes))
    second_differences = np.diff(np.eye(len(nodes)), 2, axis=0) if len(nodes) > 2 else np.empty((0, len(nodes)))
    weight: Floats = np.ones(len(value))
    fitted: Floats = np.zeros(len(nodes))
    for _ in range(5):
        matrix = weights.T @ (weights * weight[:, None])
        stiff = _STIFFNESS * np.mean(np.diagonal(matrix)) * second_differences.T @ second_differences
        # Nodes without data lie on the line through their neighbours, or at zero without any.
        fitted = np.asarray(np.linalg.solve(matrix + stiff + 1e-6 * np.eye(len(nodes)), weights.T @ (weight * value)))
        deviation = np.abs(value - weights @ fitted)
        weight = np.asarray(1.0 / np.maximum(deviation, 1e-3 + np.median(deviation)))
    return fitted
