"""One command channel: its unit, its neutral command and its range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import get_args

from agvbench.errors import OneOf, VehicleError
from agvbench.types import CommandUnit
from agvbench.vehicle.fields import coerce_float


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
