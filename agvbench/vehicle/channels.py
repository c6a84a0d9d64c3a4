"""What the three command channels of a vehicle set: a speed, and angles of axles or a yaw rate; and in which units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self, get_args

from agvbench.errors import OneOf, VehicleError
from agvbench.types import Command, Commands, CommandUnit
from agvbench.vehicle.fields import coerce_float
from agvbench.vehicle.geometry import Geometry

Role = Literal["front", "rear", "drive"]
"""A command channel, by the name of its column in the table of commands."""

ROLES: tuple[Role, ...] = ("front", "rear", "drive")

TableUnit = Literal["us", "normalised", "si", "channels"]
"""The unit of a table of commands: one for all its columns, or each column in the unit of its channel."""


@dataclass(frozen=True)
class Channel:
    """The commands that one channel takes.

    Parameters
    ----------
    unit
        ``"us"``, ``"normalised"`` or ``"si"``, as in `CommandUnit`.
    neutral
        Command at which the drive stands and an axle steers (about) straight.
    low, high
        Lowest and highest command; infinite where no range is stated.

    Raises
    ------
    VehicleError
        If the unit is unknown, `neutral` is not finite, or low < high and low ≤ neutral ≤ high do not hold.
    """

    unit: CommandUnit
    neutral: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if self.unit not in get_args(CommandUnit):
            limit = OneOf(get_args(CommandUnit))
            raise VehicleError("unknown unit", where="unit", value=repr(self.unit), limit=limit)
        coerce_float(self, "neutral")
        coerce_float(self, "low", "high", allow_infinite=True)
        if not self.low < self.high:
            raise VehicleError("is not below high", where="low", value=f"{self.low:g}", limit=f"below {self.high:g}")
        if not self.low <= self.neutral <= self.high:
            raise VehicleError("is out of range", where="neutral", value=f"{self.neutral:g}", limit=self.range_text)

    @property
    def is_bounded(self) -> bool:
        """Whether a range is stated."""
        return math.isfinite(self.low) or math.isfinite(self.high)

    def holds(self, command: float) -> bool:
        """Return whether a command is within the range."""
        return self.low <= command <= self.high

    @property
    def range_text(self) -> str:
        """The range in words."""
        return f"{self.low:g}…{self.high:g}"

    def __str__(self) -> str:
        return f"{self.unit}, neutral {self.neutral:g}{f', {self.range_text}' if self.is_bounded else ''}"


@dataclass(frozen=True)
class Channels:
    """The command channels of a vehicle: each has its own unit, neutral and range.

    A differential vehicle has no rear axle: its `rear` is its `front`, and its rear command stays at neutral.
    """

    drive: Channel
    front: Channel
    rear: Channel

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
        return "; ".join(f"{role} {getattr(self, role)}" for role in Command._fields)

    def require_within(self, commands: Commands, *, where: object) -> None:
        """Raise `VehicleError` at `where` for the first of `commands` that is out of its channel's range."""
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
