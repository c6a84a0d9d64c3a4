"""Simulated poses of a vehicle model with its effects, for one run or many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.errors import InputError, VehicleError
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Commands, Floats

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel

_LARGEST_ANGLE_RAD = math.radians(89.0)


def rollout(
    model: VehicleModel,
    commands: Sequence[Commands],
    initial: ArrayLike,
    t_s: Sequence[ArrayLike],
    started_h: Sequence[float] | None = None,
) -> list[Floats]:
    """Simulate a batch of runs and return their poses at given times.

    Until a run's first command takes effect the vehicle is at rest at the initial pose with its axles at neutral. Each
    command holds until the next one, the last one for ever. The error of integration is about 1e-6 m and rad.

    Parameters
    ----------
    model
        The vehicle.
    commands
        One `Commands` per run, in the vehicle's unit; of several at one time the last one counts.
    initial
        (runs, 3): x [m], y [m], heading [rad] in the floor frame, as the camera reports them.
    t_s
        One array per run: ascending times to report [s], on the commands' clock; may be before the first command.
    started_h
        When each run began, in hours since the session began; all at its beginning by default.

    Returns
    -------
    list of ndarray
        Per run, shape (n, 3): x [m], y [m], heading [rad] as the camera reports them; the heading is not wrapped.

    Raises
    ------
    InputError
        If the runs are not finite, not in order, or not equally many, naming the run.
    VehicleError
        If the model turns an axle beyond 89°.

    Examples
    --------
    >>> from agvbench.model import thesis_vehicle
    >>> still = Commands(np.array([0.0]), np.array([1500.0]), np.array([1500.0]), np.array([1500.0]))
    >>> rollout(thesis_vehicle(), [still], [(1.0, 2.0, 0.5)], [[0.0, 10.0]])[0].tolist()
    [[1.0, 2.0, 0.5], [1.0, 2.0, 0.5]]
    """
    poses = np.array(initial, dtype=np.float64)
    _check_counts(len(commands), poses, len(t_s))
    if not commands:
        return []
    hours = np.zeros(len(commands)) if started_h is None else started_h
    runs = [
        SimulatedRun(given, np.asarray(times, dtype=np.float64), float(hour))
        for given, times, hour in zip(commands, t_s, hours, strict=True)
    ]
    kinds = _outside_the_library([type(effect) for effect in model.effects])
    simulation = Simulation(model.geometry, model.neutral, runs, kinds=kinds)
    settled = simulation.settled(model.front, model.rear, model.drive)
    _check_angles(model, simulation, settled)
    states = np.column_stack([poses, np.zeros(len(runs))])
    return simulation.split(simulation.predict(settled, simulation.parameters(model.effects), states))


def simulate(
    model: VehicleModel, commands: Commands, initial: ArrayLike, t_s: ArrayLike, *, started_h: float = 0.0
) -> Floats:
    """Return the poses that `model`, with its effects, has at the times `t_s` of one run.

    Until the first command takes effect the vehicle is at rest at `initial` with its axles at neutral. Each command
    holds until the next one, the last one for ever.

    Parameters
    ----------
    model
        The vehicle; `VehicleModel.with_effects` adds effects.
    commands
        Commands in the vehicle's unit, such as those of a `Run` or a plan.
    initial
        Initial pose, shape (3,): x [m], y [m], heading [rad] in the floor frame; a `Pose` is one.
    t_s
        Times [s] on the commands' clock, ascending, shape (n,).
    started_h
        Hours from the beginning of the session to the run, for effects such as ``battery_droop``.

    Returns
    -------
    ndarray
        Shape (n, 3): x [m], y [m], heading [rad, not wrapped] in the floor frame, as the cameras see them.

    Raises
    ------
    InputError
        If an argument has another shape, is not finite, or times do not ascend.
    VehicleError
        If the model turns an axle beyond 89°.

    Examples
    --------
    Ten seconds straight ahead at 0.3 m/s, without and with a lag of the speed:

    >>> from agvbench.effects import SpeedLag
    >>> from agvbench.model import thesis_vehicle
    >>> model = thesis_vehicle()
    >>> command = model.command_for(front_rad=0.0, rear_rad=0.0, speed_mps=0.3)
    >>> ahead = Commands(np.array([0.0]), *(np.array([channel]) for channel in command))
    >>> simulate(model, ahead, (0.0, 0.0, 0.0), [0.0, 10.0])[:, 0].round(3).tolist()
    [0.0, 3.0]
    >>> slow = model.with_effects(SpeedLag(accelerate_s=0.5, brake_s=0.5))
    >>> simulate(slow, ahead, (0.0, 0.0, 0.0), [0.0, 10.0])[:, 0].round(3).tolist()
    [0.0, 2.85]
    """
    start = np.asarray(initial, dtype=np.float64).reshape(1, -1)
    (poses,) = rollout(model, [commands], start, [t_s], [started_h])
    return poses


def _check_counts(commands: int, initial: Floats, times: int) -> None:
    if initial.ndim != 2 or initial.shape[1] != 3:
        raise InputError("initial poses must have shape (runs, 3)", value=initial.shape)
    if not commands == len(initial) == times:
        counts = f"{commands}, {len(initial)} and {times}"
        raise InputError("commands, initial poses and times must be equally many", value=counts)
    bad = np.flatnonzero(~np.isfinite(initial).all(axis=1))
    if bad.size:
        raise InputError("initial pose is not finite", where=f"run {bad[0]}", value=initial[bad[0]])


def _check_angles(model: VehicleModel, simulation: Simulation, settled: Floats) -> None:
    for axle, angles, commands in (
        ("front", settled[:, 0], simulation.front),
        ("rear", settled[:, 1], simulation.rear),
    ):
        too_far = np.flatnonzero(np.abs(angles) > _LARGEST_ANGLE_RAD)
        if too_far.size:
            raise VehicleError(
                f"{axle} axle angle is too large",
                where=f"vehicle {model.name}",
                value=f"{math.degrees(angles[too_far[0]]):.1f}° at command {commands[too_far[0]]:g}",
                limit="±89°",
                remedy="use a map with end stops",
            )


def _outside_the_library(kinds: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Return the `kinds` outside the library: all variants if there is one, because each set is compiled separately."""
    variants = list(effect_variants().values())
    others = [kind for kind in kinds if kind not in effect_kinds().values() and kind not in variants]
    return [*(variants if any(kind in variants for kind in kinds) else []), *others]
