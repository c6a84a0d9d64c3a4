"""From a trajectory (or raw commands) and a vehicle model to timed commands, before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from agvbench.errors import PlanError, UnsuitedVehicleError, VehicleError
from agvbench.model import VehicleModel
from agvbench.planning.leg import Leg, end_pose, sample, stops, swept
from agvbench.planning.legs import legs_of
from agvbench.planning.placement import best_start, check_fits, does_not_fit
from agvbench.planning.trajectories.shapes import CommandTable
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.planning.workspace import Workspace
from agvbench.types import Command, Commands, Floats, Pose
from agvbench.vehicle.channels import Channel
from agvbench.vehicle.geometry import Geometry

_STEP_S = 0.02
_MOST_ROWS = 20_000
_ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Plan:
    """What will be commanded, and what should come of it.

    Parameters
    ----------
    trajectory
        What was planned.
    commands
        Timed commands; the last row, at `duration_s`, is the stop: the drive at neutral, the steering held, so that
        the vehicle coasts along its path. A differential vehicle has nothing to hold: all is neutral.
    duration_s
        From the first command to the stop [s].
    target
        Target pose in the start frame (`NO_TARGET` where there is none).
    expected
        Expected path in the start frame, shape (n, 4): t [s], x [m], y [m], heading [rad, unwrapped].
    floor_m
        Width and height [m] of the box, in the start frame, that both axles' centres sweep.
    start
        Start pose in the floor frame.
    geometry
        Where the vehicle's axles are.
    swept
        When and where the axles' centres pass in the start frame, shape (m, 3): t [s], x [m], y [m]; of circles driven
        over and over only the first. Then where a fast vehicle would come to rest if it were stopped (`stops`).
    """

    trajectory: Trajectory
    commands: Commands
    duration_s: float
    target: Pose
    expected: Floats
    floor_m: tuple[float, float]
    start: Pose
    geometry: Geometry
    swept: Floats


def plan(
    trajectory: Trajectory,
    model: VehicleModel,
    *,
    workspace: Workspace | None = None,
    start: Pose | None = None,
) -> Plan:
    """Return the timed commands that drive `trajectory` if `model` is right.

    The inverse of the model's static maps gives the commands, and its kinematics (thesis eq. 5.6, corrected, with
    equal axle speeds) the time that each segment takes. That holds under every condition: the kinematics are
    geometry, not calibration.

    Parameters
    ----------
    trajectory
        What to drive.
    model
        Of the vehicle: nominal maps under the condition ``uncalibrated``, measured ones otherwise.
    workspace
        The floor to stay on; not checked if not given.
    start
        Start pose in the floor frame. If not given, the one that keeps the path farthest from the edge of the
        workspace, or the floor's origin without a workspace.

    Raises
    ------
    PlanError
        If the vehicle cannot drive the trajectory, or not inside the workspace.
    """
    made = _made(trajectory, model)
    if workspace is None:
        return made if start is None else replace(made, start=start)
    if start is None:
        return replace(made, start=place(made, workspace))
    check_fits(made.swept, start, workspace, where=trajectory.name)
    return replace(made, start=start)


def _made(trajectory: Trajectory, model: VehicleModel) -> Plan:
    """Return the plan that starts at the origin of the floor frame."""
    if trajectory.commands is not None:
        commands, legs = commands_and_legs(trajectory, model)
    else:
        legs = legs_of(trajectory, model)
        commands = commands_of(legs, model)
    duration = float(commands.t_s[-1])
    expected = sample(legs, model.geometry, max(_STEP_S, duration / _MOST_ROWS))
    stated = trajectory.stated_target
    passed = swept(legs, model.geometry)
    width, height = np.ptp(passed[:, 1:], axis=0).tolist()
    return Plan(
        trajectory=trajectory,
        commands=commands,
        duration_s=duration,
        target=end_pose(expected) if stated is None else stated,
        expected=expected,
        floor_m=(width, height),
        start=_ORIGIN,
        geometry=model.geometry,
        swept=np.concatenate([passed, stops(expected)]),
    )


def place(made: Plan, workspace: Workspace) -> Pose:
    """Return the start pose in the floor frame that keeps a plan's path farthest from the workspace's edge.

    Raises
    ------
    PlanError
        If the path does not fit, wherever it starts.
    """
    start, distance = best_start(made.swept[:, 1:], workspace)
    if distance < workspace.margin_m - 1e-6:
        raise does_not_fit(distance, workspace, where=made.trajectory.name)
    return start


def commands_of(legs: Sequence[Leg], model: VehicleModel) -> Commands:
    """Return the commands that drive `legs` and then stop; raise `PlanError` if the model knows none for a leg."""
    rows: list[tuple[float, Command]] = []
    t = 0.0
    for leg in legs:
        command = _command(leg, model)
        if not rows or command != rows[-1][1]:
            rows.append((t, command))
        t += leg.duration_s
    rows.append((t, model.stop_after(rows[-1][1])))
    return commands_from_rows([(at, *command) for at, command in rows])


def _command(leg: Leg, model: VehicleModel) -> Command:
    try:
        if leg.is_rest:
            # Neutral is what the drive's electronics take for a stop; a fitted map need not be zero there.
            return model.stop_after(model.steering_for(leg.front, leg.rear))
        return model.command_for(leg.front, leg.rear, leg.speed_mps)
    except (VehicleError, PlanError) as error:
        raise PlanError(
            f"speed {abs(leg.speed_mps):.3f} m/s cannot be commanded: {error.what}",
            where=leg.where,
            limit=error.limit,
            remedy=error.remedy,
        ) from None


Row = tuple[float, float, float, float]
_UNIT_RANGE = {"us": (500.0, 2500.0), "normalised": (-1.0, 1.0), "si": (-20.0, 20.0)}
"""What may be commanded at all: beyond 500 to 2500 µs servos run against their stops."""


def command_range(channel: Channel) -> tuple[float, float]:
    """Return the lowest and highest command of a channel that a table may hold."""
    low, high = _UNIT_RANGE[channel.unit]
    return max(low, channel.low), min(high, channel.high)


def commands_from_rows(rows: Sequence[Row]) -> Commands:
    """Return commands from rows of t_s, drive, front, rear."""
    t, drive, front, rear = np.array(rows, dtype=np.float64).T.copy()
    return Commands(t, drive, front, rear)


def commands_and_legs(trajectory: Trajectory, model: VehicleModel) -> tuple[Commands, list[Leg]]:
    """Return a trajectory's own commands with the stop behind them, and the legs that they drive.

    Raise `PlanError` if they are in another unit than the vehicle's, or beyond what may be commanded in it.
    """
    table = trajectory.commands
    assert table is not None  # noqa: S101 - only called for raw commands
    _check(table, trajectory.name, model)
    stop = model.stop_after(Command(*table.rows[-1][1:]))
    commands = commands_from_rows([*table.rows, (table.duration_s, *stop)])
    fronts, rears = model.axle_angles(commands.front, commands.rear)
    speeds = model.speed(commands.drive)
    legs = [
        Leg(
            f"{trajectory.name}: commands.rows[{i}]",
            float(fronts[i]),
            float(rears[i]),
            0.0 if commands.drive[i] == model.neutral.drive else float(speeds[i]),
            float(commands.t_s[i + 1] - commands.t_s[i]),
            is_rest=model.stop_after(commands.at(i)) == commands.at(i),
        )
        for i in range(len(commands) - 1)
    ]
    return commands, legs


def _check(table: CommandTable, name: str, model: VehicleModel) -> None:
    if table.unit != model.channels.table_unit:
        raise UnsuitedVehicleError(
            "commands are in another unit than the vehicle's",
            where=f"{name}: commands.unit",
            value=table.unit,
            limit=model.channels.table_unit,
        )
    for i, row in enumerate(table.rows):
        for column, value in zip(("drive", "front", "rear"), row[1:], strict=True):
            low, high = command_range(getattr(model.channels, column))
            if not low <= value <= high:
                raise PlanError(
                    f"{column} command is out of range",
                    where=f"{name}: commands.rows[{i}]",
                    value=f"{value:g}",
                    limit=f"{low:g} to {high:g}",
                )
