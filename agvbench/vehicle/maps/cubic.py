"""A third-order polynomial on the stretch where it is monotone (thesis eq. 7.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from agvbench.errors import VehicleError
from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float, require_ascending
from agvbench.vehicle.maps.base import StaticMap
from agvbench.vehicle.maps.solve import solve_monotone


@dataclass(frozen=True)
class Cubic(StaticMap):
    """``output = cubic · c³ + quadratic · c² + linear · c + constant`` for commands c in a declared range.

    The range picks the branch: a cubic that turns around inside it is refused. Coefficients need all their
    digits: those printed in eq. 7.3 give −0.49 m/s at neutral, where a refit gives +0.02.

    Parameters
    ----------
    cubic, quadratic, linear, constant
        Coefficients of c³, c², c and 1.
    command_low, command_high
        Range in which the polynomial holds; beyond it the output stays.

    Examples
    --------
    >>> drive = Cubic(3.7419e-9, -1.69804e-5, 2.43017e-2, -10.85699, command_low=1200.0, command_high=1830.0)
    >>> round(float(drive(1600.0)), 3), round(float(drive.inverse(0.16)), 1)
    (-0.117, 1393.2)
    """

    kind: ClassVar[str] = "cubic"

    cubic: float
    quadratic: float
    linear: float
    constant: float
    command_low: float
    command_high: float

    def __post_init__(self) -> None:
        coerce_float(self, "cubic", "quadratic", "linear", "constant", "command_low", "command_high")
        require_ascending(self, "command_low", "command_high")
        slopes = self._extreme_slopes()
        if not (min(slopes) >= 0.0 or max(slopes) <= 0.0) or slopes == [0.0] * len(slopes):
            raise VehicleError(
                "the cubic turns around inside its range of commands",
                value=f"slope {min(slopes):.3g} … {max(slopes):.3g}",
                remedy="narrow command_low … command_high to the branch that is meant",
            )

    def _extreme_slopes(self) -> list[float]:
        """Return the slope at both ends of the range and, if it lies inside, at the point of inflection."""
        at = [self.command_low, self.command_high]
        if (
            self.cubic != 0.0
            and self.command_low < (vertex := -self.quadratic / (3.0 * self.cubic)) < self.command_high
        ):
            at.append(vertex)
        return [float(self._slope(np.asarray(command))) for command in at]

    @property
    def command_range(self) -> tuple[float, float]:
        """The declared range of commands."""
        return self.command_low, self.command_high

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return the drive of the thesis, a rising one in −1…1, and a straight line in disguise."""
        return (
            cls(3.7419e-9, -1.69804e-5, 2.43017e-2, -10.85699, 1200.0, 1830.0),
            cls(0.5, 0.1, 0.9, -0.02, -1.0, 1.0),
            cls(0.0, 0.0, -2.0, 0.0, -1.0, 1.0),
        )

    def _output(self, command: Floats) -> Floats:
        return ((self.cubic * command + self.quadratic) * command + self.linear) * command + self.constant

    def _command(self, output: Floats) -> Floats:
        low, high = (np.full_like(output, end) for end in self.command_range)
        return solve_monotone(self._output, self._slope, output, low, high)

    def _slope(self, command: Floats) -> Floats:
        return (3.0 * self.cubic * command + 2.0 * self.quadratic) * command + self.linear
