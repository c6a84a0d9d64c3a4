"""The command message: what the vehicle is commanded, when, and for how long."""

from __future__ import annotations

import math
from typing import Annotated, Final

from msgspec import Meta

from agvbench.bus.messages.codec import Message, Number, Source, decoder
from agvbench.errors import MessageError
from agvbench.types import Command

MAX_HOLD_S = 3600.0
_INFINITE = math.inf


class CommandFlags:
    """What else a command asks for; bits as plain integers, since arithmetic with enums costs a microsecond each."""

    NONE: Final = 0
    STOP: Final = 1
    """Neutral at once, whatever the numbers say; in lock step, the runner does not wait for frames."""
    FLUSH: Final = 2
    """Send the frames that are still under way; no time passes."""
    KEEP_ALIVE: Final = 4
    """The command that holds already, said again: the runner lives."""


class CommandMessage(Message, tag="command", frozen=True):
    """A command with its place in the run.

    ``t_s`` [s] is the run clock when it takes effect (0: the run's first command), ``hold_s`` [s] how long it
    is meant to hold: a vehicle that hears nothing after that stops by itself.

    Raises
    ------
    MessageError
        If a number is not finite, or `hold_s` is out of range.
    """

    sequence: Number
    t_s: float
    command: Command
    hold_s: float
    flags: Annotated[int, Meta(ge=0, le=7)] = CommandFlags.NONE
    source: Source = 0

    def __post_init__(self) -> None:
        drive, front, rear = self.command
        # A sum is finite only if all its terms are; where it overflows, the terms are looked at one by one.
        if not (-_INFINITE < self.t_s + drive + front + rear < _INFINITE) and not all(
            map(math.isfinite, (self.t_s, *self.command))
        ):
            raise MessageError("command is not finite", value=f"t_s={self.t_s}, {tuple(self.command)}")
        if not 0.0 <= self.hold_s <= MAX_HOLD_S:
            raise MessageError(
                "command's hold is out of range", value=f"{self.hold_s} s", limit=f"0 to {MAX_HOLD_S:g} s"
            )


decode_command = decoder(CommandMessage)
