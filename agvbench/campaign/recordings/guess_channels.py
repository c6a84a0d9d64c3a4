"""Guess the unit and the neutral of command columns from their values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agvbench.types import CommandUnit, Floats
from agvbench.vehicle.channel_tables import si_unit

_LOWEST_PULSE_US, _HIGHEST_PULSE_US = 400.0, 2600.0


class GuessedChannel(NamedTuple):
    """A guessed channel, and the lowest and highest command that was ``seen``."""

    unit: CommandUnit
    neutral: float
    low: float
    high: float
    seen: tuple[float, float]

    def lines(self, name: str) -> list[str]:
        """Return the lines of the table of this channel, called `name` in files."""
        return [
            f'unit = "{si_unit(name) if self.unit == "si" else self.unit}"',
            f"neutral = {self.neutral:.1f}",
            f"low = {self.low:.6g}   # ? the lowest and the highest command that it takes",
            f"high = {self.high:.6g}",
        ]


def guess_channels(values: Mapping[str, Floats], *, is_si: bool) -> dict[str, GuessedChannel]:
    """Return a channel for each role from its commands (n,), NaN where unknown.

    All that are no pulse widths share a unit: SI units if `is_si` or one is beyond ±1. An axle that is commanded
    between 0 and 1 is taken to be straight halfway.
    """
    seen = {role: (float(np.nanmin(own)), float(np.nanmax(own))) for role, own in values.items()}
    pulses = {role for role, (low, high) in seen.items() if low >= _LOWEST_PULSE_US and high <= _HIGHEST_PULSE_US}
    largest = max((abs(end) for role, ends in seen.items() if role not in pulses for end in ends), default=0.0)
    found = {}
    for role, (low, high) in seen.items():
        if role in pulses:
            found[role] = GuessedChannel("us", 1500.0, min(low, 1000.0), max(high, 2000.0), (low, high))
        elif is_si or largest > 1.0:
            found[role] = GuessedChannel("si", 0.0, -largest, largest, (low, high))
        elif low >= 0.0 and role != "drive":
            found[role] = GuessedChannel("normalised", 0.5, 0.0, 1.0, (low, high))
        else:
            found[role] = GuessedChannel("normalised", 0.0, -1.0, 1.0, (low, high))
    return found


def questions_about(channels: Mapping[str, GuessedChannel]) -> dict[str, str]:
    """Return by role what to ask: the neutral of what is never negative, the unit of what stands beside pulse widths.

    A vehicle that never drove backward is not asked about if its steering says where neutral is.
    """
    others = {role: channel for role, channel in channels.items() if channel.unit != "us"}
    steered = any(channel.seen[0] < 0.0 for role, channel in others.items() if role != "drive")
    questions = {}
    for role, channel in others.items():
        low, high = channel.seen
        if low >= 0.0 and not (role == "drive" and steered):
            questions[role] = f"never negative ({low:g} to {high:g}); is {channel.neutral:g} neutral?"
        elif len(others) < len(channels):
            questions[role] = f"in {channel.unit} units?"
    return questions
