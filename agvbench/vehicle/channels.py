"""What the three command channels of a vehicle set: a speed, and angles of axles or a yaw rate; and in which units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

from agvbench.errors import VehicleError
from agvbench.types import Command, Commands, CommandUnit
from agvbench.vehicle.channel import Channel
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.wheels import Wheels

__all__ = ["ROLES", "Channel", "Channels", "Quantity", "Role", "TableUnit", "channels_of", "quantity_of"]

Role = Literal["front", "rear", "drive"]
"""A command channel, by the name of its column in the table of commands."""

ROLES: tuple[Role, ...] = ("front", "rear", "drive")

TableUnit = Literal["us", "normalised", "si", "channels"]
"""The unit of a table of commands: one for all its columns, or each column in the unit of its channel."""


@dataclass(frozen=True)
class Channels:
    """The command channels of a vehicle: each has its own unit, neutral and range.

    A differential vehicle has no rear axle: its `rear` is its `front`, and its rear command stays at neutral. If it is
    commanded by two wheel speeds, `wheels` describes them, and the other channels are those of the body.
    """

    drive: Channel
    front: Channel
    rear: Channel
    wheels: Wheels | None = None

    @classmethod
    def of_wheels(cls, wheels: Wheels) -> Self:
        """Return the channels of a differential vehicle that is commanded by two wheel speeds."""
        return cls(wheels.drive, wheels.front, wheels.front, wheels)

    def limited(self, command: Command) -> Command:
        """Return the command that is carried out where a wheel saturates; see `Wheels.limited`."""
        return command if self.wheels is None else self.wheels.limited(command)

    @classmethod
    def alike(cls, unit: CommandUnit, neutral: float | None = None) -> Self:
        """Return three channels of one unit and neutral, by default 1500 µs or 0, without a stated range.

        >>> Channels.alike("us").neutral
        Command(drive=1500.0, front=1500.0, rear=1500.0)

        Raises
        ------
        VehicleError
            If the unit is unknown or `neutral` is not finite; the line names ``command_unit`` or ``neutral``.
        """
        if neutral is None:
            neutral = 1500.0 if unit == "us" else 0.0
        try:
            channel = Channel(unit, neutral)
        except VehicleError as error:
            place = {"unit": "command_unit"}.get(str(error.where), str(error.where))
            raise VehicleError(error.what, where=place, value=error.value, limit=error.limit) from None
        return cls(channel, channel, channel)

    @property
    def neutral(self) -> Command:
        """The command at which the vehicle stands and steers (about) straight."""
        return Command(self.drive.neutral, self.front.neutral, self.rear.neutral)

    @property
    def common(self) -> Channel | None:
        """The channel that all three are, if they are alike and no range is stated."""
        return self.drive if self.drive == self.front == self.rear and not self.drive.is_bounded else None

    @property
    def table_unit(self) -> TableUnit:
        """The unit of all channels, or ``"channels"`` if they have different ones."""
        return self.drive.unit if self.drive.unit == self.front.unit == self.rear.unit else "channels"

    def __str__(self) -> str:
        if (common := self.common) is not None:
            return str(common)
        if self.wheels is not None:
            return str(self.wheels)
        return "; ".join(f"{role} {getattr(self, role)}" for role in Command._fields)

    def require_within(self, commands: Commands, *, where: object) -> None:
        """Raise `VehicleError` at `where` for the first of `commands` that is out of its channel's range."""
        if self.wheels is not None:
            self.wheels.require_within(commands, where=where)
            return
        for role in ROLES:
            channel: Channel = getattr(self, role)
            for value in getattr(commands, role):
                if not channel.holds(float(value)):
                    raise VehicleError(
                        f"{role} command is out of its channel's range", where=where, value=f"{value:g}",
                        limit=channel.range_text, remedy="correct the command, or the range in the vehicle file",
                    )  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """What a channel sets.

    Parameters
    ----------
    channel
        What people call the channel: ``"front axle"``, ``"yaw rate"``.
    name
        What it sets: ``"angle"``, ``"speed"`` or ``"yaw rate"``.
    scale
        From the SI unit to `unit`.
    unit, word
        The unit people read, as a symbol (``"°"``) and in tables (``"deg"``).
    """

    channel: str
    name: str
    scale: float = 1.0
    unit: str = ""
    word: str = ""

    def text(self, value: float, form: str = ".3g") -> str:
        """Return an SI value with its unit, the number in this `form`."""
        return f"{self.scale * value:{form}}{'' if self.unit == '°' else ' '}{self.unit}"


_DEG = math.degrees(1.0)
_TWO_AXLE = {
    "front": Quantity("front axle", "angle", _DEG, "°", "deg"),
    "rear": Quantity("rear axle", "angle", _DEG, "°", "deg"),
    "drive": Quantity("drive", "speed", 1.0, "m/s", "m/s"),
}
_YAW_RATE = Quantity("yaw rate", "yaw rate", 1.0, "rad/s", "rad/s")


def quantity_of(role: str, geometry: Geometry) -> Quantity:
    """Return what the channel `role` of a vehicle sets.

    >>> quantity_of("front", Geometry(0.0, 0.1, kinematics="differential")).text(0.5)
    '0.5 rad/s'
    """
    return _YAW_RATE if geometry.is_differential and role == "front" else _TWO_AXLE[role]


def channels_of(geometry: Geometry) -> tuple[Role, ...]:
    """Return the channels that a vehicle has: a differential one has no rear axle to steer."""
    return ("front", "drive") if geometry.is_differential else ROLES
