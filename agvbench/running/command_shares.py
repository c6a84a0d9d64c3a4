"""Commands as shares of full command, held for a while one after another (thesis fig. 7.1 and 7.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import FlagError, VehicleError
from agvbench.model import VehicleModel
from agvbench.types import Command, Commands, CommandUnit
from agvbench.vehicle.channels import Channel
from agvbench.vehicle.maps import StaticMap

PRESTEER_S = 0.5
_FULL_COMMAND: dict[CommandUnit, float] = {"us": 600.0, "normalised": 1.0, "si": 1.0}
"""In SI units a map's own range says what full command is, if it has one."""


@dataclass(frozen=True)
class Shares:
    """Shares of full command: drive 1 is full speed forward, steering 1 is full command to the left.

    ``drive``, ``front`` and ``rear`` are what a share of 1 adds to ``neutral``, in command units; 0 for an axle
    that is not steered.
    """

    neutral: Command
    drive: float
    front: float
    rear: float

    @classmethod
    def of_model(cls, model: VehicleModel) -> Shares:
        """Return the shares of a vehicle; which way its outputs go with the command is read from its maps."""
        return cls(model.neutral, *(_full_command(model, role) for role in Command._fields))

    def command(self, drive: float = 0.0, front: float = 0.0, rear: float = 0.0) -> Command:
        """Return the command of three shares.

        >>> Shares(Command(1500.0, 1500.0, 1500.0), drive=-600.0, front=-600.0, rear=-600.0).command(drive=1, front=0.5)
        Command(drive=900.0, front=1200.0, rear=1500.0)

        Raises
        ------
        FlagError
            If a share is not between −1 and 1.
        """
        for name, share in {"drive": drive, "front": front, "rear": rear}.items():
            if not -1.0 <= share <= 1.0:
                raise FlagError(f"share of full {name} command is out of range", value=share, limit="−1 to 1")
        at = self.neutral
        return Command(at.drive + drive * self.drive, at.front + front * self.front, at.rear + rear * self.rear)


def _full_command(model: VehicleModel, role: str) -> float:
    """Return what a share of 1 adds to neutral; 0 for a map without a direction.

    Raise `VehicleError` if the channel's range leaves no command on one side of neutral.
    """
    static_map: StaticMap = getattr(model, role)
    channel: Channel = getattr(model.channels, role)
    neutral, full = channel.neutral, _FULL_COMMAND[channel.unit]
    low, high = (abs(end - neutral) for end in static_map.command_range)
    if channel.unit == "si" and math.isfinite(max(low, high)):
        full = max(low, high)
    below, above = static_map(np.array([neutral - full, neutral + full]))
    if below == above:
        return 0.0
    full = min(full, neutral - channel.low, channel.high - neutral)
    if full == 0.0:
        raise VehicleError(
            f"{role} is driven to both sides of neutral, but its channel's range ends there",
            where=f"vehicle {model.name}", value=f"neutral {neutral:g}", limit=channel.range_text,
            remedy="correct neutral and range",
        )  # fmt: skip
    return float(np.sign(above - below)) * full


def held(model: VehicleModel, steps: Sequence[tuple[float, Command]], *, presteer_s: float = PRESTEER_S) -> Commands:
    """Return commands that hold each of `steps` (duration [s], command) in turn, then stop.

    The steering is set `presteer_s` before the vehicle drives, so that the arc is steered from its beginning;
    after the stop it stays as it is, since a vehicle at rest should not turn its wheels while its pose is read. A
    differential vehicle has no steering to set: it begins with the first of `steps`.
    """
    commands = [command for _, command in steps]
    durations = [duration for duration, _ in steps]
    if not model.geometry.is_differential:
        commands, durations = [model.stop_after(commands[0]), *commands], [presteer_s, *durations]
    columns = np.array([*commands, model.stop_after(commands[-1])], dtype=float)
    times = np.concatenate([[0.0], np.cumsum(durations)])
    return Commands(times, columns[:, 0], columns[:, 1], columns[:, 2])


def falling(first: float, last: float) -> list[float]:
    """Return numbers from `first` down to `last`, a tenth less each.

    >>> falling(1.0, 0.8)
    [1.0, 0.9, 0.81, 0.8]
    >>> falling(2.0, 2.0)
    [2.0]
    """
    numbers = [first]
    while numbers[-1] > last:
        numbers.append(max(last, round(0.9 * numbers[-1], 3)))
    return numbers
