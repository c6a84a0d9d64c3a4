"""An output that no command changes: an axle that is not steered."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float
from agvbench.vehicle.maps.base import StaticMap


@dataclass(frozen=True)
class Fixed(StaticMap):
    """``output`` whatever the command: the rear axle of a vehicle that steers only in front.

    Parameters
    ----------
    output
        The output; 0 for an axle that points straight ahead.
    command
        The command to send all the same: the vehicle's neutral.

    Examples
    --------
    >>> rear = Fixed()
    >>> rear([-1.0, 1.0]).tolist(), float(rear.inverse(0.0))
    ([0.0, 0.0], 0.0)
    """

    kind: ClassVar[str] = "fixed"

    output: float = 0.0
    command: float = 0.0

    def __post_init__(self) -> None:
        coerce_float(self, "output", "command")

    @property
    def command_range(self) -> tuple[float, float]:
        """Every command."""
        return -math.inf, math.inf

    @property
    def output_range(self) -> tuple[float, float]:
        """The one output."""
        return self.output, self.output

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return an axle straight ahead in −1…1 and a skew one in µs."""
        return cls(), cls(output=0.01, command=1500.0)

    def _output(self, command: Floats) -> Floats:
        return np.full_like(command, self.output)

    def _command(self, output: Floats) -> Floats:
        return np.full_like(output, self.command)
