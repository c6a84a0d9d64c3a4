"""What the firmware says, read strictly: whatever is not exactly one of these is noise."""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import IntEnum
from typing import Final, NamedTuple, TypeAlias

NAME: Final = "agvbench"
"""What the firmware calls itself."""


class ErrorCode(IntEnum):
    """Why a line was refused (``enum error`` in ``firmware/src/protocol.h``)."""

    COMMAND = 1
    SYNTAX = 2
    RANGE = 3
    FULL = 4
    LENGTH = 5
    BYTES = 6
    CHECKSUM = 7

    @property
    def meaning(self) -> str:
        """In words."""
        return _MEANINGS[self]


_MEANINGS = {
    ErrorCode.COMMAND: "no such command",
    ErrorCode.SYNTAX: "fields are missing, too many, or not numbers",
    ErrorCode.RANGE: "a number is out of its range",
    ErrorCode.FULL: "no room for another segment",
    ErrorCode.LENGTH: "line is too long",
    ErrorCode.BYTES: "bytes were lost, garbled or not printable",
    ErrorCode.CHECKSUM: "checksum is wrong or missing",
}


class Hello(NamedTuple):
    """The vehicle's identity: sent after a reset, and in answer to ``V``."""

    firmware_version: int
    protocol_version: int
    unit: str
    calibration_hash: str


class Accepted(NamedTuple):
    """The command or segment of this number was understood."""

    sequence: int


class Refused(NamedTuple):
    """A line was not understood and moved nothing; number 0 where it could not be read."""

    sequence: int
    code: ErrorCode


class WatchdogBit(NamedTuple):
    """The vehicle heard nothing for 250 ms and went to neutral by itself."""


class Status(NamedTuple):
    """What the pulses [µs] are meant to be, how many segments wait, and the state (0 idle to 3 stopped by watchdog)."""

    drive_us: int
    front_us: int
    rear_us: int
    queued: int
    state: int


Reply: TypeAlias = Hello | Accepted | Refused | WatchdogBit | Status

_N = r"(\d{1,5})"
_FORMS: list[tuple[re.Pattern[str], Callable[..., Reply]]] = [
    (re.compile(f"ok {_N}"), lambda number: Accepted(int(number))),
    (re.compile(f"err {_N} ([1-7])"), lambda number, code: Refused(int(number), ErrorCode(int(code)))),
    (re.compile("W"), WatchdogBit),
    (re.compile(f"Q {_N} {_N} {_N} ([0-8]) ([0-3])"), lambda *numbers: Status(*map(int, numbers))),
    (
        re.compile(rf"V {NAME} {_N} {_N} (us|deg) (\w{{1,64}})"),
        lambda firmware, protocol, unit, calibration: Hello(int(firmware), int(protocol), unit, calibration),
    ),
]


def parse_reply(text: str) -> Reply | None:
    """Return what a line says, None if nothing.

    >>> parse_reply("err 7 3").code.meaning, parse_reply("ok seven")
    ('a number is out of its range', None)
    """
    for form, make in _FORMS:
        if (found := form.fullmatch(text)) is not None:
            return make(*found.groups())
    return None
