"""Two wheel speeds as commands of a differential vehicle, and their conversion to body velocity and yaw rate.

Files, cables and foreign recordings have a command for each wheel. Everything else has commands of the body: a speed
and a yaw rate. The conversion is linear and exact, so that neither loses anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agvbench.errors import VehicleError
from agvbench.types import Command, Commands, CommandUnit, Floats
from agvbench.vehicle.channel import Channel
from agvbench.vehicle.fields import coerce_float

LONGEST_M = 20.0
"""No track and no radius is longer [m]."""
# Rounding of the conversion, relative to the range: a command at the end of the range is within it.
_ROUNDING = 1e-9


class WheelCommand(NamedTuple):
    """The commands of both wheels, each in the unit of its channel."""

    left: float
    right: float


@dataclass(frozen=True)
class Wheels:
    """The command channels of two wheels, and what the conversion needs.

    In SI units body commands are m/s and rad/s. In other units, which are deviations from each wheel's neutral, they
    are half the sum and half the difference (right minus left); static maps give them units.

    Parameters
    ----------
    left, right
        The channels of both wheels: one unit, any neutrals and finite ranges.
    track_m
        Distance between both wheels [m]; 0 unless the unit is ``"si"``.
    wheel_radius_m
        Radius [m] by which commands in rad/s are multiplied; 0 where commands are not angular speeds.

    Raises
    ------
    VehicleError
        If units differ, a range is not finite or ends at neutral, or a length does not fit the unit.
    """

    left: Channel
    right: Channel
    track_m: float = 0.0
    wheel_radius_m: float = 0.0

    def __post_init__(self) -> None:
        coerce_float(self, "track_m", "wheel_radius_m")
        if self.left.unit != self.right.unit:
            raise VehicleError(
                "both wheels need one unit", where="channels.right.unit", value=self.right.unit, limit=self.left.unit
            )
        for name, channel in zip(WheelCommand._fields, self.channels, strict=True):
            if not channel.low < channel.neutral < channel.high or math.isinf(channel.high - channel.low):
                raise VehicleError(
                    "a wheel turns both ways, within a finite range", where=f"channels.{name}", value=str(channel),
                    limit="low < neutral < high",
                )  # fmt: skip
        self._check_lengths()

    def _check_lengths(self) -> None:
        if not 0.0 <= self.wheel_radius_m <= LONGEST_M:
            raise _length_error("wheel_radius_m", self.wheel_radius_m)
        if self.unit != "si":
            if self.track_m or self.wheel_radius_m:
                raise VehicleError(
                    "track_m and wheel_radius_m need commands in m/s or rad/s", where="channels", value=self.unit,
                    remedy="delete them: the static maps contain them",
                )  # fmt: skip
        elif not 0.0 < self.track_m <= LONGEST_M:
            raise _length_error("track_m", self.track_m)

    @property
    def unit(self) -> CommandUnit:
        """The unit of both wheels, and of the commands of the body."""
        return self.left.unit

    @property
    def _metres(self) -> float:
        """What a unit of a wheel's command is in units of the body's speed."""
        return self.wheel_radius_m or 1.0

    @property
    def _half_track(self) -> float:
        return 0.5 * self.track_m or 1.0

    @property
    def drive(self) -> Channel:
        """The channel of the body's speed: neutral 0, and the range that both wheels reach together."""
        return self._channel(self.left.low, self.right.low, self.left.high, self.right.high)

    @property
    def front(self) -> Channel:
        """The channel of the yaw rate: neutral 0, and the range of turns on the spot."""
        channel = self._channel(2.0 * self.left.neutral - self.left.high, self.right.low,
                                2.0 * self.left.neutral - self.left.low, self.right.high)  # fmt: skip
        return Channel(channel.unit, 0.0, channel.low / self._half_track, channel.high / self._half_track)

    def _channel(self, left_low: float, right_low: float, left_high: float, right_high: float) -> Channel:
        low = max(left_low - self.left.neutral, right_low - self.right.neutral)
        high = min(left_high - self.left.neutral, right_high - self.right.neutral)
        return Channel(self.unit, 0.0, self._metres * low, self._metres * high)

    def body(self, left: ArrayLike, right: ArrayLike) -> tuple[Floats, Floats]:
        """Return the commands of speed and yaw rate (n,) of wheel commands (n,).

        >>> wheel = Channel("si", 0.0, -1.0, 1.0)
        >>> [float(value) for value in Wheels(wheel, wheel, track_m=0.4).body(0.2, 0.4)]
        [0.30000000000000004, 0.5]
        """
        own = self._metres * (np.asarray(left, dtype=np.float64) - self.left.neutral)
        other = self._metres * (np.asarray(right, dtype=np.float64) - self.right.neutral)
        return 0.5 * (own + other), 0.5 * (other - own) / self._half_track

    def wheels(self, drive: ArrayLike, front: ArrayLike) -> tuple[Floats, Floats]:
        """Return the wheel commands (n,) of speed and yaw rate commands (n,), whatever their range."""
        speed, apart = np.asarray(drive, dtype=np.float64), self._half_track * np.asarray(front, dtype=np.float64)
        return self.left.neutral + (speed - apart) / self._metres, self.right.neutral + (speed + apart) / self._metres

    def share(self, drive: float, front: float) -> float:
        """Return the largest share of a body command that both wheels can carry out; 1 if all of it."""
        shares = [1.0]
        for channel, value in zip(self.channels, self.wheels(drive, front), strict=True):
            end = channel.high if value > channel.neutral else channel.low
            beyond = (float(value) - channel.neutral) / (end - channel.neutral)
            shares.append(1.0 / beyond if beyond > 1.0 + _ROUNDING else 1.0)
        return min(shares)

    def limited(self, command: Command) -> Command:
        """Return the body command that is carried out: where a wheel saturates, both slow down by one share.

        The ratio of yaw rate to speed, and thereby the curvature of the path, is kept.
        """
        share = self.share(command.drive, command.front)
        return command if share == 1.0 else command._replace(drive=share * command.drive, front=share * command.front)

    def command(self, command: Command) -> WheelCommand:
        """Return what both wheels are commanded, within their ranges; see `limited`.

        >>> wheel = Channel("us", 1500.0, 1000.0, 2000.0)
        >>> Wheels(wheel, wheel).command(Command(400.0, 600.0, 0.0))
        WheelCommand(left=1400.0, right=2000.0)
        """
        body = self.limited(command)
        values = self.wheels(body.drive, body.front)
        return WheelCommand(*(_clipped(float(v), c) for v, c in zip(values, self.channels, strict=True)))

    def require_within(self, commands: Commands, *, where: object) -> None:
        """Raise `VehicleError` at `where` for the first of `commands` of which a wheel is out of its range."""
        for drive, front in zip(commands.drive.tolist(), commands.front.tolist(), strict=True):
            if (share := self.share(drive, front)) == 1.0:
                continue
            for name, channel, value in zip(
                WheelCommand._fields, self.channels, self.wheels(drive, front), strict=True
            ):
                if not channel.holds(float(value)):
                    raise VehicleError(
                        f"{name} wheel command is out of its channel's range", where=where, value=f"{value:.4g}",
                        limit=channel.range_text,
                        remedy=f"drive at most {100.0 * share:.0f} % of this speed, or correct the range",
                    )  # fmt: skip

    @property
    def channels(self) -> tuple[Channel, Channel]:
        """The channels of the left and the right wheel."""
        return self.left, self.right

    @property
    def neutral(self) -> WheelCommand:
        """The command at which both wheels stand."""
        return WheelCommand(self.left.neutral, self.right.neutral)

    def __str__(self) -> str:
        lengths = [f"track {self.track_m:g} m"] if self.track_m else []
        lengths += [f"wheel radius {self.wheel_radius_m:g} m"] if self.wheel_radius_m else []
        return "; ".join([f"left {self.left}", f"right {self.right}", *lengths])


def _clipped(value: float, channel: Channel) -> float:
    return min(max(value, channel.low), channel.high)


def _length_error(name: str, value: float) -> VehicleError:
    return VehicleError("is no length that a vehicle has", where=f"channels.{name}", value=f"{value:g} m",
                        limit=f"above 0, at most {LONGEST_M:g} m")  # fmt: skip
