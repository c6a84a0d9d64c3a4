"""A straight line between two mechanical end stops."""

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
class LineWithEndStops(StaticMap):
    """``output = slope · command + intercept``, held between `output_low` and `output_high`.

    The steering servos of the thesis stop near ±40°, inside the range of pulses: tables 7.1 and 7.2 are a line
    with two or three saturated points at each end. An end stop that was never reached is infinite.

    Parameters
    ----------
    slope
        Output per command unit between the stops; not zero.
    intercept
        Output at command 0 if there were no stops.
    output_low, output_high
        The stops.

    Examples
    --------
    >>> servo = LineWithEndStops(slope=-0.0015, intercept=2.25, output_low=-0.7, output_high=0.69)
    >>> float(servo(900.0)), round(float(servo.inverse(0.69)), 6)
    (0.69, 1040.0)
    """

    kind: ClassVar[str] = "line_with_end_stops"

    slope: float
    intercept: float
    output_low: float = -math.inf
    output_high: float = math.inf

    def __post_init__(self) -> None:
        coerce_float(self, "slope", "intercept")
        coerce_float(self, "output_low", "output_high", allow_infinite=True)
        require_ascending(self, "output_low", "output_high")
        if self.slope == 0.0:
            raise VehicleError("a line without slope has no inverse", where="slope", remedy='use kind = "fixed"')

    @property
    def command_range(self) -> tuple[float, float]:
        """The commands at which the stops are reached."""
        first, last = ((end - self.intercept) / self.slope for end in (self.output_low, self.output_high))
        return min(first, last), max(first, last)

    @property
    def output_range(self) -> tuple[float, float]:
        """The stops."""
        return self.output_low, self.output_high

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return a steering servo in µs, one in −1…1, and one whose upper stop is unknown."""
        return cls(-0.0015, 2.23, -0.73, 0.70), cls(0.6, -0.01, -0.4, 0.41), cls(-0.0015, 2.23, -0.7)

    def _output(self, command: Floats) -> Floats:
        return np.clip(self.slope * command + self.intercept, self.output_low, self.output_high)

    def _command(self, output: Floats) -> Floats:
        return (output - self.intercept) / self.slope
