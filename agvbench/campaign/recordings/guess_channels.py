"""Guess the unit and the neutral of command columns from their values."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from agvbench.campaign.recordings.mapping import ANGLE, LENGTH
from agvbench.types import CommandUnit, Floats
from agvbench.vehicle.channel_tables import si_unit

_LOWEST_PULSE_US, _HIGHEST_PULSE_US = 400.0, 2600.0
_PER_S = r"(_s|/s|ps|_per_s)"
_STATED_UNITS = {
    rf"rad{_PER_S}?|m{_PER_S}": 1.0,
    rf"deg(rees)?{_PER_S}?": ANGLE["deg"],
    rf"mm{_PER_S}": LENGTH["mm"],
    rf"cm{_PER_S}": LENGTH["cm"],
    r"km_?/?h|kph": 1.0 / 3.6,
}
_RIGHT_ANGLE_RAD = 0.5 * math.pi


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


def stated_scale(column: str) -> float | None:
    """Return by what the numbers of a column become SI units, as the end of its name says; None if it says nothing.

    >>> stated_scale("speed (km/h)"), stated_scale("steering")
    (0.2777777777777778, None)
    """
    matching = (scale for unit, scale in _STATED_UNITS.items() if re.search(rf"[\W_]({unit})\W*$", column.lower()))
    return next(matching, None)


def guess_channels(values: Mapping[str, Floats], *, si: Collection[str] = ()) -> dict[str, GuessedChannel]:
    """Return a channel for each role from its commands (n,), NaN where unknown.

    The roles `si` are in SI units. All others that are no pulse widths share a unit: SI units if one is beyond ±1. An
    axle that is commanded between 0 and 1 is taken to be straight halfway.
    """
    seen = {role: (float(np.nanmin(own)), float(np.nanmax(own))) for role, own in values.items()}
    pulses = {role for role, (low, high) in seen.items() if low >= _LOWEST_PULSE_US and high <= _HIGHEST_PULSE_US}
    pulses -= {*si}
    sizes = {role: max(map(abs, ends)) for role, ends in seen.items() if role not in pulses}
    largest = max((size for role, size in sizes.items() if role not in si), default=0.0)
    found = {}
    for role, (low, high) in seen.items():
        if role in si:
            found[role] = GuessedChannel("si", 0.0, -sizes[role], sizes[role], (low, high))
        elif role in pulses:
            found[role] = GuessedChannel("us", 1500.0, min(low, 1000.0), max(high, 2000.0), (low, high))
        elif largest > 1.0:
            found[role] = GuessedChannel("si", 0.0, -largest, largest, (low, high))
        elif low >= 0.0 and role != "drive":
            found[role] = GuessedChannel("normalised", 0.5, 0.0, 1.0, (low, high))
        else:
            found[role] = GuessedChannel("normalised", 0.0, -1.0, 1.0, (low, high))
    return found


def questions_about(channels: Mapping[str, GuessedChannel], *, has_axles: bool) -> dict[str, str]:
    """Return by role what to ask: the neutral of what is never negative, the unit of what stands beside pulse widths.

    Also the unit of an axle angle beyond 90°. A vehicle that never drove backward is not asked about if its steering
    says where neutral is.
    """
    others = {role: channel for role, channel in channels.items() if channel.unit != "us"}
    steered = any(channel.seen[0] < 0.0 for role, channel in others.items() if role != "drive")
    questions = {}
    for role, channel in others.items():
        low, high = channel.seen
        if has_axles and role != "drive" and channel.unit == "si" and max(-low, high) > _RIGHT_ANGLE_RAD:
            questions[role] = f"an axle at {max(-low, high):g} rad? in degrees it needs scale = 0.0174533"
        elif low >= 0.0 and not (role == "drive" and steered):
            questions[role] = f"never negative ({low:g} to {high:g}); is {channel.neutral:g} neutral?"
        elif len(others) < len(channels):
            questions[role] = f"in {channel.unit} units?"
    return questions
