"""What a vehicle model predicts for a batch of runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from agvbench.errors import VehicleError
from agvbench.model.batch import RolloutBatch
from agvbench.model.kernel import SLOTS, simulate
from agvbench.types import Commands, Floats

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel

_LARGEST_ANGLE_RAD = math.radians(89.0)


def rollout(
    model: VehicleModel, commands: Sequence[Commands], initial: ArrayLike, t_s: Sequence[ArrayLike]
) -> list[Floats]:
    """Simulate a batch of runs and return their poses at the times asked for.

    Until a run's first command takes effect the vehicle stands at the initial pose with its axles at neutral. Each
    command holds until the next, the last one for ever. The error stays near 1e-9 m and rad.

    Parameters
    ----------
    model
        The vehicle.
    commands
        One `Commands` per run, in the vehicle's unit; times ascend strictly.
    initial
        (runs, 3): x [m], y [m], heading [rad] in the floor frame.
    t_s
        One array per run: ascending times to report [s], on the commands' clock; may be before the first command.

    Returns
    -------
    list of ndarray
        Per run, shape (n, 3): x [m], y [m], heading [rad]; the heading is continuous, not wrapped.

    Raises
    ------
    InputError
        If the runs are not finite, not in order, or not equally many, naming the run.
    VehicleError
        If the model has an effect that cannot be simulated, or turns an axle beyond 89°.

    Examples
    --------
    >>> from agvbench.model import thesis_vehicle
    >>> still = Commands(np.array([0.0]), np.array([1500.0]), np.array([1500.0]), np.array([1500.0]))
    >>> thesis_vehicle().rollout([still], [(1.0, 2.0, 0.5)], [[0.0, 10.0]])[0].tolist()
    [[1.0, 2.0, 0.5], [1.0, 2.0, 0.5]]
    """
    batch = RolloutBatch.pack(commands, initial, t_s)
    runs = len(batch.initial)
    out = np.empty((3, batch.t_s.size))
    simulate(
        np.tile(kernel_parameters(model), (runs, 1)),
        initial_states(model, batch.initial),
        settled_targets(model, batch),
        batch.command_t_s,
        batch.command_starts,
        batch.t_s,
        batch.starts,
        out,
    )
    return batch.split(out)


def has_fast_kernel(model: VehicleModel) -> bool:
    """Return whether the kernel knows every effect of `model`."""
    return all(effect.is_null or f"{effect.name}.{name}" in SLOTS for effect in model.effects for name in effect.values)


def kernel_parameters(model: VehicleModel) -> Floats:
    """Return the numbers of `model` that the kernel needs beside the static maps, in the order of `SLOTS`.

    Raises
    ------
    VehicleError
        If an effect of the model has no place in the kernel.
    """
    values = dict.fromkeys(SLOTS, 0.0)
    values["geometry.front_axle_m"] = model.geometry.front_axle_m
    values["geometry.rear_axle_m"] = model.geometry.rear_axle_m
    for effect in model.effects:
        for name, value in effect.values.items():
            slot = f"{effect.name}.{name}"
            if slot not in values and not effect.is_null:
                raise VehicleError("this effect cannot be simulated", where=f"vehicle {model.name}", value=effect.name)
            values[slot] = value
    return np.array([values[slot] for slot in SLOTS])


def initial_states(model: VehicleModel, initial: Floats) -> Floats:
    """Return (runs, 6): the initial poses with axles at neutral and at rest."""
    front, rear = model.axle_angles(model.neutral, model.neutral)
    rest = np.broadcast_to([float(front), float(rear), 0.0], (len(initial), 3))
    return np.hstack([initial, rest])


def settled_targets(model: VehicleModel, batch: RolloutBatch) -> Floats:
    """Return (commands, 3): settled front angle, rear angle and speed of every command.

    Raises
    ------
    VehicleError
        If a map without end stops turns an axle beyond 89°.
    """
    front, rear = model.axle_angles(batch.front, batch.rear)
    for axle, angles, commands in (("front", front, batch.front), ("rear", rear, batch.rear)):
        too_far = np.flatnonzero(np.abs(angles) > _LARGEST_ANGLE_RAD)
        if too_far.size:
            raise VehicleError(
                f"{axle} axle angle is too large",
                where=f"vehicle {model.name}",
                value=f"{math.degrees(angles[too_far[0]]):.1f}° at command {commands[too_far[0]]:g}",
                limit="±89°",
                remedy="use a map with end stops",
            )
    return np.column_stack([front, rear, model.speed(batch.drive)])
