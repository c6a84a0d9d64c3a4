"""What a command looks like to each version of the firmware."""

from __future__ import annotations

from dataclasses import dataclass

from agvbench.adapters.serial_line.replies import Hello
from agvbench.errors import LinkError
from agvbench.types import Command
from agvbench.vehicle.channels import ROLES, Channels

PROTOCOL_VERSION = 1
NEUTRAL_US = 1500.0
US_PER_DEGREE = 40.0 / 3.0
_NEUTRAL_DEGREE = 90


@dataclass(frozen=True)
class Dialect:
    """The numbers one version takes, whether it knows checksums, and after how long [s] its watchdog bites."""

    unit: str
    lowest: int
    highest: int
    checksums: bool
    watchdog_s: float | None = None

    def numbers(self, command: Command, *, where: object = None) -> tuple[int, int, int]:
        """Return drive, front and rear [µs] as the firmware's whole numbers, nearest first.

        Raises
        ------
        LinkError
            If the firmware does not take one of them.
        """
        drive, front, rear = (self._number(name, value, where) for name, value in command._asdict().items())
        return drive, front, rear

    def _number(self, name: str, pulse_us: float, where: object) -> int:
        number = round(pulse_us if self.unit == "us" else _NEUTRAL_DEGREE + (pulse_us - NEUTRAL_US) / US_PER_DEGREE)
        if not self.lowest <= number <= self.highest:
            limits = (self.pulse_us(self.lowest), self.pulse_us(self.highest))
            raise LinkError(
                f"{name} pulse is out of what the firmware takes",
                where=where,
                value=f"{pulse_us:g} µs",
                limit=f"{limits[0]:g} to {limits[1]:g} µs",
            )
        return number

    def pulse_us(self, number: int) -> float:
        """Return the pulse [µs] that a number stands for."""
        return float(number) if self.unit == "us" else NEUTRAL_US + (number - _NEUTRAL_DEGREE) * US_PER_DEGREE


DIALECTS = {1: Dialect("deg", 30, 150, checksums=False), 2: Dialect("us", 600, 2400, checksums=True, watchdog_s=0.25)}
"""By version of the firmware."""


def check_channels(channels: Channels, *, where: object = None) -> None:
    """Raise `LinkError` unless commands are in microseconds and the drive stops where the firmware's watchdog does."""
    if channels.wheels is not None:
        raise LinkError("the firmware takes no wheel commands", where=where, value=str(channels.wheels))
    for role in ROLES:
        if (unit := getattr(channels, role).unit) != "us":
            raise LinkError("the firmware takes microseconds", where=where, value=unit, limit="command unit us")
    if (neutral := channels.drive.neutral) != NEUTRAL_US:
        raise LinkError(
            "the firmware's watchdog stops the drive at another pulse", where=where, value=f"neutral {neutral:g} µs",
            limit=f"{NEUTRAL_US:g} µs", remedy="trim the speed controller to it",
        )  # fmt: skip


def dialect_of(hello: Hello, *, where: object = None) -> Dialect:
    """Return how to talk to the firmware that said `hello`.

    Raises
    ------
    LinkError
        If it speaks a protocol that this version of agvbench does not.
    """
    dialect = DIALECTS.get(hello.firmware_version)
    if hello.protocol_version != PROTOCOL_VERSION or dialect is None or dialect.unit != hello.unit:
        raise LinkError(
            "vehicle has a firmware that this agvbench does not know",
            where=where,
            value=f"firmware {hello.firmware_version}, protocol {hello.protocol_version}, {hello.unit}",
            limit=f"firmware {' or '.join(map(str, DIALECTS))}, protocol {PROTOCOL_VERSION}",
            remedy="flash the firmware that ships with it",
        )
    return dialect
