"""Trajectories that are raw commands: nothing is inverted, the model only says where they lead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.legs import Leg
from agvbench.planning.shapes import CommandTable
from agvbench.planning.trajectory import Trajectory
from agvbench.types import Commands

Row = tuple[float, float, float, float]
_UNIT_RANGE = {"us": (500.0, 2500.0), "normalised": (-1.0, 1.0)}
"""What may be commanded at all: beyond 500 to 2500 µs servos run against their stops."""


def from_rows(rows: Sequence[Row]) -> Commands:
    """Return commands from rows of t_s, drive, front, rear."""
    t, drive, front, rear = np.array(rows, dtype=np.float64).T.copy()
    return Commands(t, drive, front, rear)


def commands_and_legs(trajectory: Trajectory, model: VehicleModel) -> tuple[Commands, list[Leg]]:
    """Return a trajectory's own commands with the stop behind them, and the legs that they drive.

    Raises
    ------
    PlanError
        If they are in another unit than the vehicle's, or beyond what may be commanded in it.
    """
    table = trajectory.commands
    assert table is not None  # noqa: S101 - only called for raw commands
    _check(table, trajectory.name, model)
    *_, front, rear = table.rows[-1]
    commands = from_rows([*table.rows, (table.duration_s, model.neutral, front, rear)])
    fronts, rears = model.axle_angles(commands.front, commands.rear)
    speeds = model.speed(commands.drive)
    legs = [
        Leg(
            f"{trajectory.name}: commands.rows[{i}]",
            float(fronts[i]),
            float(rears[i]),
            0.0 if drive == model.neutral else float(speeds[i]),
            float(commands.t_s[i + 1] - commands.t_s[i]),
        )
        for i, drive in enumerate(commands.drive[:-1])
    ]
    return commands, legs


def _check(table: CommandTable, name: str, model: VehicleModel) -> None:
    if table.unit != model.command_unit:
        raise UnsuitedVehicleError(
            "commands are in another unit than the vehicle's",
            where=f"{name}: commands.unit",
            value=table.unit,
            limit=model.command_unit,
        )
    low, high = _UNIT_RANGE[table.unit]
    for i, row in enumerate(table.rows):
        for column, value in zip(("drive", "front", "rear"), row[1:], strict=True):
            if not low <= value <= high:
                raise PlanError(
                    f"{column} command is out of range",
                    where=f"{name}: commands.rows[{i}]",
                    value=f"{value:g}",
                    limit=f"{low:g} to {high:g}",
                )
