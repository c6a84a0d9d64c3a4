"""A measured curve: points, joined monotonically."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from agvbench.errors import OneOf, VehicleError
from agvbench.types import Floats
from agvbench.vehicle.maps.base import StaticMap
from agvbench.vehicle.maps.solve import solve_monotone

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

_INTERPOLATIONS = ("pchip", "linear")


@dataclass(frozen=True)
class MonotoneTable(StaticMap):
    """Measured points joined by monotone cubic pieces (``"pchip"``, Fritsch and Carlson 1980) or straight ones.

    Outputs may repeat: a dead band or an end stop is a flat stretch. They may not turn around: smooth or thin out
    noisy measurements first.

    Parameters
    ----------
    commands
        Strictly ascending commands, at least two.
    outputs
        Output at each command, ascending or descending throughout.
    interpolation
        ``"pchip"`` (smooth, default) or ``"linear"``.

    Examples
    --------
    >>> drive = MonotoneTable((1200.0, 1400.0, 1480.0, 1540.0, 1800.0), (0.32, 0.16, 0.0, 0.0, -0.3))
    >>> round(float(drive.inverse(0.16)), 6), float(drive.inverse(0.0))
    (1400.0, 1510.0)
    """

    kind: ClassVar[str] = "monotone_table"

    commands: tuple[float, ...]
    outputs: tuple[float, ...]
    interpolation: str = "pchip"

    def __post_init__(self) -> None:
        for name in ("commands", "outputs"):
            points = np.asarray(getattr(self, name), dtype=np.float64)
            if points.ndim != 1 or not np.all(np.isfinite(points)):
                raise VehicleError("must be a list of finite numbers", where=name)
            object.__setattr__(self, name, tuple(points.tolist()))
        self._check_points()
        if self.interpolation not in _INTERPOLATIONS:
            limit = OneOf(_INTERPOLATIONS)
            raise VehicleError("unknown interpolation", where="interpolation", value=self.interpolation, limit=limit)

    def _check_points(self) -> None:
        if len(self.commands) != len(self.outputs):
            value = f"{len(self.commands)} and {len(self.outputs)}"
            raise VehicleError("commands and outputs must be equally many", value=value)
        if len(self.commands) < 2:
            raise VehicleError("a table needs more points", value=len(self.commands), limit="at least 2")
        if not np.all(np.diff(self.commands) > 0.0):
            raise VehicleError("commands must ascend", where="commands")
        steps = np.diff(self.outputs)
        if np.any(steps > 0.0) == np.any(steps < 0.0):
            raise VehicleError("outputs must ascend or descend throughout", where="outputs")

    @property
    def command_range(self) -> tuple[float, float]:
        """The first and last command of the table."""
        return self.commands[0], self.commands[-1]

    @property
    def output_range(self) -> tuple[float, float]:
        """The lowest and highest output of the table."""
        return min(self.outputs), max(self.outputs)

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return a falling drive with dead band and saturation, and a rising steering curve in −1…1."""
        return (
            cls((900.0, 1200.0, 1400.0, 1480.0, 1540.0, 1800.0, 2100.0), (0.32, 0.32, 0.16, 0.0, 0.0, -0.3, -0.31)),
            cls((-1.0, -0.4, 0.1, 0.7, 1.0), (-0.5, -0.2, 0.04, 0.33, 0.4), "linear"),
            cls((-1.0, -0.4, 0.1, 0.7, 1.0), (-0.5, -0.2, 0.04, 0.33, 0.4)),
        )

    def _output(self, command: Floats) -> Floats:
        if self.interpolation == "linear":
            return np.interp(command, self.commands, self.outputs)
        return np.asarray(self._pchip(command))

    def _slope(self, command: Floats) -> Floats:
        if self.interpolation == "pchip":
            return np.asarray(self._pchip(command, 1))
        slopes = np.diff(self.outputs) / np.diff(self.commands)
        piece = np.searchsorted(self.commands, command, side="right") - 1
        return np.asarray(slopes[np.clip(piece, 0, len(slopes) - 1)])

    def _command(self, output: Floats) -> Floats:
        sign = 1.0 if self.outputs[-1] > self.outputs[0] else -1.0
        knots, rising, wanted = np.asarray(self.commands), sign * np.asarray(self.outputs), sign * output
        first = np.searchsorted(rising, wanted, side="left")
        last = np.searchsorted(rising, wanted, side="right") - 1
        between = last < first
        # Strictly between two knots, `last` is the one before and `first` the one after.
        left, right = knots[np.where(between, last, first)], knots[np.where(between, first, last)]
        solved = self._solve(output, left, right)
        flat = np.where(first == 0, right, np.where(last == len(knots) - 1, left, 0.5 * (left + right)))
        return np.where(between, solved, flat)

    def _solve(self, output: Floats, left: Floats, right: Floats) -> Floats:
        if self.interpolation == "linear":
            low, high = self._output(left), self._output(right)
            rise = np.where(high == low, 1.0, high - low)
            return np.asarray(left + np.clip((output - low) / rise, 0.0, 1.0) * (right - left))
        return solve_monotone(self._output, self._slope, output, left, right)

    @cached_property
    def _pchip(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator

        # The inverse of a denormal slope overflows on the way to a derivative of zero, which is right.
        with np.errstate(over="ignore"):
            return PchipInterpolator(np.asarray(self.commands), np.asarray(self.outputs))
