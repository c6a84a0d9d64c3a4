"""A drive that does not move near neutral and saturates towards full command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from agvbench.errors import VehicleError
from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float, require_ascending
from agvbench.vehicle.maps.base import StaticMap


@dataclass(frozen=True)
class DeadBandWithSaturation(StaticMap):
    """Zero inside a dead band; on each side of it a rise that ends at full output.

    With u from 0 at the edge of the dead band to 1 at saturation, a side is ``output = full · (1 − (1 − u)^exponent)``:
    exponent 1 is a straight ramp, 2 a parabola that flattens towards saturation, as table 7.4 of the thesis
    does (−0.116 m/s at 1600 µs, −0.192 at 1650, … −0.325 at 1850 and beyond).

    Parameters
    ----------
    low_saturation, low_edge, high_edge, high_saturation
        Ascending commands: saturation and edge of the dead band on the side of low commands, then on the other side.
        The edges may coincide: then there is no dead band.
    low_output, high_output
        Output at and beyond the two saturations, of opposite sign.
    low_exponent, high_exponent
        Curvature of each side, at least 1 (default: straight).

    Examples
    --------
    >>> drive = DeadBandWithSaturation(1200.0, 1480.0, 1540.0, 1840.0, low_output=0.32, high_output=-0.32)
    >>> drive([900.0, 1500.0, 1690.0]).tolist(), float(drive.inverse(0.0))
    ([0.32, 0.0, -0.16], 1510.0)
    """

    kind: ClassVar[str] = "dead_band_with_saturation"

    low_saturation: float
    low_edge: float
    high_edge: float
    high_saturation: float
    low_output: float
    high_output: float
    low_exponent: float = 1.0
    high_exponent: float = 1.0

    def __post_init__(self) -> None:
        coerce_float(self, "low_saturation", "low_edge", "high_edge", "high_saturation")
        coerce_float(self, "low_output", "high_output", "low_exponent", "high_exponent")
        require_ascending(self, "low_saturation", "low_edge")
        require_ascending(self, "low_edge", "high_edge", strict=False)
        require_ascending(self, "high_edge", "high_saturation")
        if not self.low_output * self.high_output < 0.0:
            value = f"{self.low_output} and {self.high_output}"
            raise VehicleError("low_output and high_output must have opposite signs", value=value)
        for name in ("low_exponent", "high_exponent"):
            if getattr(self, name) < 1.0:
                raise VehicleError("exponent is too small", where=name, value=getattr(self, name), limit="at least 1")

    @property
    def command_range(self) -> tuple[float, float]:
        """The two saturations."""
        return self.low_saturation, self.high_saturation

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return a falling drive in µs, a rising one in −1…1, and one without a dead band."""
        return (
            cls(1180.0, 1480.0, 1545.0, 1860.0, 0.322, -0.324, 1.7, 2.1),
            cls(-0.9, -0.05, 0.08, 0.95, -0.6, 1.1),
            cls(-1.0, 0.0, 0.0, 1.0, -2.0, 2.0, 1.0, 1.3),
        )

    def _output(self, command: Floats) -> Floats:
        low, high = self._rise(command)
        return self.low_output * (1.0 - (1.0 - low) ** self.low_exponent) + self.high_output * (
            1.0 - (1.0 - high) ** self.high_exponent
        )

    def _command(self, output: Floats) -> Floats:
        low_share = np.clip(output / self.low_output, 0.0, 1.0)
        high_share = np.clip(output / self.high_output, 0.0, 1.0)
        low = self.low_edge - self._low_width * (1.0 - (1.0 - low_share) ** (1.0 / self.low_exponent))
        high = self.high_edge + self._high_width * (1.0 - (1.0 - high_share) ** (1.0 / self.high_exponent))
        centre = 0.5 * (self.low_edge + self.high_edge)
        return np.where(low_share > 0.0, low, np.where(high_share > 0.0, high, centre))

    def _rise(self, command: Floats) -> tuple[Floats, Floats]:
        """Return u on the low and on the high side, 0 … 1."""
        low = np.clip((self.low_edge - command) / self._low_width, 0.0, 1.0)
        high = np.clip((command - self.high_edge) / self._high_width, 0.0, 1.0)
        return low, high

    @property
    def _low_width(self) -> float:
        return self.low_edge - self.low_saturation

    @property
    def _high_width(self) -> float:
        return self.high_saturation - self.high_edge
