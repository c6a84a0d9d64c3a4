"""A straight line (thesis section 7.3, first-order fit)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from agvbench.errors import VehicleError
from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float, require_ascending
from agvbench.vehicle.maps.base import StaticMap


@dataclass(frozen=True)
class Line(StaticMap):
    """``output = slope · command + intercept`` between two commands (thesis eq. 7.1 and 7.2).

    Parameters
    ----------
    slope
        Output per command unit; not zero.
    intercept
        Output at command 0.
    command_low, command_high
        Commands beyond which nothing changes: the range of the controller; infinite by default.

    Examples
    --------
    >>> nominal = Line(slope=-0.001309, intercept=1.9635, command_low=900.0, command_high=2100.0)
    >>> float(nominal(1500.0)), float(nominal.inverse(0.1309))
    (0.0, 1400.0)
    """

    kind: ClassVar[str] = "line"

    slope: float
    intercept: float
    command_low: float = -math.inf
    command_high: float = math.inf

    def __post_init__(self) -> None:
        coerce_float(self, "slope", "intercept")
        coerce_float(self, "command_low", "command_high", allow_infinite=True)
        require_ascending(self, "command_low", "command_high")
        if self.slope == 0.0:
            raise VehicleError("a line without slope has no inverse", where="slope", remedy='use kind = "fixed"')

    @classmethod
    def through(cls, zero_command: float, slope: float, *, command_low: float, command_high: float) -> Self:
        """Return the line that is zero at `zero_command`."""
        return cls(slope, -slope * zero_command, command_low, command_high)

    @property
    def command_range(self) -> tuple[float, float]:
        """The declared range of commands."""
        return self.command_low, self.command_high

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return a steering servo in µs and a drive in −1…1."""
        return cls(-0.001466, 2.1817, 900.0, 2100.0), cls(0.8, 0.02, -1.0, 1.0)

    def _output(self, command: Floats) -> Floats:
        return self.slope * command + self.intercept

    def _command(self, output: Floats) -> Floats:
        return np.clip((output - self.intercept) / self.slope, *self.command_range)
