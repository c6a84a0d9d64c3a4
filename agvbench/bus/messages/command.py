"""The command message: what the vehicle is told, when, and for how long.

Body after the header: ``t_s``, ``drive``, ``front``, ``rear``, ``hold_s`` (f64 each).
"""

from __future__ import annotations

import math
import struct
from typing import Final, NamedTuple

from agvbench.bus.messages.wire import Kind, check_length, prefix, unpack_header
from agvbench.errors import MessageError
from agvbench.types import Command

MAX_HOLD_S = 3600.0

# Header and body in one: a process that has just been woken pays for every Python call tenfold.
_MESSAGE = struct.Struct("<6sHIIQ5d")
_PREFIX = prefix(Kind.COMMAND)
# Bound once, and named tuples without their Python constructor: a process just woken fetches all from memory.
_pack, _unpack, _tuple, _INFINITE = _MESSAGE.pack, _MESSAGE.unpack, tuple.__new__, math.inf


class CommandFlags:
    """What else a command asks for; bits as plain integers, since arithmetic with enums costs a microsecond each."""

    NONE: Final = 0
    STOP: Final = 1
    """Neutral at once, whatever the numbers say; in lock step, nobody waits for frames."""
    FLUSH: Final = 2
    """Send the frames that are still under way; no time passes."""
    KEEP_ALIVE: Final = 4
    """The command that holds already, said again: the runner lives."""


_KNOWN = CommandFlags.STOP | CommandFlags.FLUSH | CommandFlags.KEEP_ALIVE


class CommandMessage(NamedTuple):
    """A command with its place in the run.

    ``t_s`` [s] is the run clock when it takes effect (0: the run's first command), ``hold_s`` [s] how long it
    is meant to hold: a vehicle that hears nothing after that stops by itself.
    """

    sequence: int
    t_s: float
    command: Command
    hold_s: float
    flags: int = CommandFlags.NONE
    source: int = 0


def pack_command(sequence: int, t_s: float, command: Command, hold_s: float, flags: int, source: int) -> bytes:
    """Return the 64 bytes of a message with these fields, see `CommandMessage`.

    Raises
    ------
    MessageError
        If a number is not finite, or `hold_s` is out of range.
    """
    drive, front, rear = command
    # A sum is finite only if all its terms are; where it overflows, the terms are looked at one by one.
    if not (-_INFINITE < t_s + drive + front + rear < _INFINITE and 0.0 <= hold_s <= MAX_HOLD_S):
        _check(t_s, command, hold_s)
    return _pack(_PREFIX, flags, source, 1, sequence, t_s, drive, front, rear, hold_s)


def encode_command(message: CommandMessage) -> bytes:
    """Return the message's bytes, or raise as `pack_command`."""
    return pack_command(*message)


def decode_command(payload: bytes) -> CommandMessage:
    """Return the message that `payload` holds.

    Raises
    ------
    MessageError
        If it is not a command message that this version writes.
    """
    if len(payload) != _MESSAGE.size:
        raise _refusal(payload)
    found, flags, source, count, sequence, t_s, drive, front, rear, hold_s = _unpack(payload)
    if found != _PREFIX or count != 1 or flags > _KNOWN:
        raise _refusal(payload)
    command = _tuple(Command, (drive, front, rear))
    if not (-_INFINITE < t_s + drive + front + rear < _INFINITE and 0.0 <= hold_s <= MAX_HOLD_S):
        _check(t_s, command, hold_s)
    return _tuple(CommandMessage, (sequence, t_s, command, hold_s, flags, source))


def _refusal(payload: bytes) -> MessageError:
    """Return what is wrong with a message that cannot be decoded."""
    try:
        header = unpack_header(payload, Kind.COMMAND, _KNOWN)
        if header.rows == 1:
            check_length(payload, _MESSAGE.size)
    except MessageError as error:
        return error
    return MessageError("command message with another count", value=header.rows, limit=1)


def _check(t_s: float, command: Command, hold_s: float) -> None:
    if not all(map(math.isfinite, (t_s, *command))):
        raise MessageError("command is not finite", value=f"t_s={t_s}, {tuple(command)}")
    if not 0.0 <= hold_s <= MAX_HOLD_S:
        raise MessageError("command's hold is out of range", value=f"{hold_s} s", limit=f"0 to {MAX_HOLD_S:g} s")
