"""A drive of which only full speed and stop are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from agvbench.errors import VehicleError
from agvbench.types import Floats
from agvbench.vehicle.fields import coerce_float, require_ascending
from agvbench.vehicle.maps.base import StaticMap

_SAME_SPEED = 1e-6


@dataclass(frozen=True)
class FullSpeedOrStop(StaticMap):
    """Full speed at either end of the commands, stop in the middle, and no knowledge of what lies between.

    This is what is known of a drive before it is calibrated (thesis table 6.2). The inverse gives these three commands
    only: asked for any other speed it refuses, which is why the uncalibrated vehicle has no trajectory at half speed.
    The output of a command in between is a guess along straight lines.

    Parameters
    ----------
    command_low, command_stop, command_high
        Ascending commands.
    output_low, output_high
        Speeds at the two ends, of opposite sign.

    Examples
    --------
    >>> drive = FullSpeedOrStop(900.0, 1500.0, 2100.0, output_low=0.32, output_high=-0.32)
    >>> drive.inverse([0.32, 0.0]).tolist()
    [900.0, 1500.0]
    >>> drive.inverse(0.16)
    Traceback (most recent call last):
    agvbench.errors.VehicleError: no command is known for this output: 0.16 (limit: 0.32, 0, -0.32); calibrate the drive
    """

    kind: ClassVar[str] = "full_speed_or_stop"

    command_low: float
    command_stop: float
    command_high: float
    output_low: float
    output_high: float

    def __post_init__(self) -> None:
        coerce_float(self, "command_low", "command_stop", "command_high", "output_low", "output_high")
        require_ascending(self, "command_low", "command_stop", "command_high")
        if not self.output_low * self.output_high < 0.0:
            value = f"{self.output_low} and {self.output_high}"
            raise VehicleError("output_low and output_high must have opposite signs", value=value)

    @property
    def command_range(self) -> tuple[float, float]:
        """The commands of full speed."""
        return self.command_low, self.command_high

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return the thesis' drive (table 6.2) and one in −1…1."""
        return cls(900.0, 1500.0, 2100.0, 0.32, -0.32), cls(-1.0, 0.0, 1.0, -0.5, 0.6)

    def _output(self, command: Floats) -> Floats:
        return np.interp(command, *self._points)

    def _command(self, output: Floats) -> Floats:
        commands, speeds = self._points
        index = np.argmin(np.abs(output[..., None] - speeds), axis=-1)
        known = np.abs(speeds[index] - output) <= _SAME_SPEED * np.max(np.abs(speeds))
        if not np.all(known):
            raise VehicleError(
                "no command is known for this output",
                value=f"{float(output[~known].flat[0]):.6g}",
                limit=f"{self.output_low:g}, 0, {self.output_high:g}",
                remedy="calibrate the drive",
            )
        return np.asarray(commands[index])

    @property
    def _points(self) -> tuple[Floats, Floats]:
        commands = np.array([self.command_low, self.command_stop, self.command_high])
        return commands, np.array([self.output_low, 0.0, self.output_high])
