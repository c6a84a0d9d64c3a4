"""The frames message: a batch of motion capture frames, a row each.

Body after the header: acknowledged (u64), clock (u8 and 7 bytes of zero), now_s (f64), then rows of ``t_s``, ``x_m``,
``y_m``, ``heading_rad``, ``mean_error_m``, ``received_s`` (f64), ``frame`` (i64), ``tracked`` (u8): 48 bytes and 57 a
frame. Rows of many messages lie one behind another when joined, and become columns at once: in real time, a recorder
has one frame in each of thousands of messages.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from agvbench.bus.wire import HEADER_BYTES, MAX_ROWS, Kind, check_length, prefix, unpack_header
from agvbench.errors import MessageError
from agvbench.types import Frames

# Header and body in one: a process that has just been woken pays for every Python call tenfold.
_HEAD = struct.Struct("<6sHIIQQB7xd")
_PREFIX = prefix(Kind.FRAMES)
# Bound once, and named tuples without their Python constructor, for the same reason.
_pack, _unpack, _tuple = _HEAD.pack, _HEAD.unpack_from, tuple.__new__
_ROWS_AT = _HEAD.size
_ROW = struct.Struct("<6dq?")
_FIELDS = ("t_s", "x_m", "y_m", "heading_rad", "mean_error_m", "received_s")
_ROWS = np.dtype([*((name, "<f8") for name in _FIELDS), ("frame", "<i8"), ("tracked", "u1")])


class FrameClock(IntEnum):
    """Which clock the time stamps of frames are in."""

    RUN = 0
    """The run's: 0 is its first command. Only a simulation in lock step knows it."""
    ADAPTER = 1
    """The mocap adapter's own; the link brings it into the run's."""


class FramesFlags:
    """What else a frames message says; bits as plain integers."""

    NONE: Final = 0
    LAST: Final = 1
    """The last message that answers the acknowledged command."""


# One frame as it travels, from plain numbers: t_s, x_m, y_m, heading_rad, mean_error_m, received_s, frame, tracked.
pack_row = _ROW.pack
_LAST, _ROW_BYTES = FramesFlags.LAST, _ROW.size
_CLOCKS = {int(clock): clock for clock in FrameClock}


class FramesMessage(NamedTuple):
    """Frames, and which command had been carried out when they were published.

    ``rows`` are the frames as they travel (`pack_rows`, `unpack_rows`); ``acknowledged`` is the sequence number of
    the command (0 in real time), ``now_s`` [s] the publisher's clock when it published.
    """

    sequence: int
    rows: bytes
    acknowledged: int = 0
    clock: FrameClock = FrameClock.RUN
    now_s: float = 0.0
    flags: int = FramesFlags.NONE
    source: int = 0

    @property
    def frame_count(self) -> int:
        """How many frames there are."""
        return len(self.rows) // _ROW.size

    def frames(self) -> Frames:
        """Return the frames, or raise `MessageError` if their numbers cannot be."""
        return unpack_rows([self.rows])


def pack_rows(frames: Frames) -> bytes:
    """Return frames as they travel.

    Raises
    ------
    MessageError
        If columns differ in length.
    """
    columns = (
        frames.t_s, frames.x_m, frames.y_m, frames.heading_rad, frames.mean_error_m, frames.received_s, frames.frame,
        frames.tracked,
    )  # fmt: skip
    count, *others = map(len, columns)
    if others != [count] * 7:
        raise MessageError("columns of frames differ in length", value=[count, *others])
    if count == 1:
        t_s, x_m, y_m, heading_rad, mean_error_m, received_s, frame, tracked = columns
        return _ROW.pack(t_s[0], x_m[0], y_m[0], heading_rad[0], mean_error_m[0], received_s[0], frame[0], tracked[0])
    rows = np.empty(count, _ROWS)
    for name, column in zip(_ROWS.names or (), columns, strict=True):
        rows[name] = column
    return rows.tobytes()


def unpack_rows(parts: Sequence[bytes]) -> Frames:
    """Return the frames of several messages, one behind another.

    Raises
    ------
    MessageError
        If a capture time is not finite, or ``tracked`` neither 0 nor 1.
    """
    rows = np.frombuffer(b"".join(parts), _ROWS)
    t_s, tracked = np.ascontiguousarray(rows["t_s"]), np.ascontiguousarray(rows["tracked"])
    if not np.isfinite(t_s).all():
        raise MessageError("frames without a finite capture time", value=float(t_s[~np.isfinite(t_s)][0]))
    if (tracked > 1).any():
        raise MessageError("tracked is neither 0 nor 1", value=int(tracked.max()))
    x_m, y_m, heading_rad, mean_error_m, received_s = (np.ascontiguousarray(rows[name]) for name in _FIELDS[1:])
    frame = np.ascontiguousarray(rows["frame"])
    return Frames(t_s, x_m, y_m, heading_rad, tracked.view(np.bool_), frame, mean_error_m, received_s)


def pack_frames(
    sequence: int, rows: bytes, acknowledged: int, clock: FrameClock, now_s: float, flags: int, source: int
) -> bytes:
    """Return the bytes of a message with these fields, see `FramesMessage`.

    Raises
    ------
    MessageError
        If there are more than `MAX_ROWS` frames.
    """
    count = len(rows) // _ROW.size
    if count > MAX_ROWS:
        raise MessageError("too many frames for one message", value=count, limit=f"at most {MAX_ROWS}")
    return _pack(_PREFIX, flags, source, count, sequence, acknowledged, clock, now_s) + rows


def encode_frames(message: FramesMessage) -> bytes:
    """Return the message's bytes, or raise as `pack_frames`."""
    return pack_frames(*message)


def decode_frames(payload: bytes) -> FramesMessage:
    """Return the message that `payload` holds; its rows are looked at by `unpack_rows`.

    Raises
    ------
    MessageError
        If it is not a frames message that this version writes.
    """
    if len(payload) < _ROWS_AT:
        raise _refusal(payload)
    found, flags, source, count, sequence, acknowledged, clock, now_s = _unpack(payload)
    good = found == _PREFIX and flags <= _LAST and count <= MAX_ROWS and clock in _CLOCKS
    if not good or len(payload) != _ROWS_AT + _ROW_BYTES * count:
        raise _refusal(payload)
    return _tuple(FramesMessage, (sequence, payload[_ROWS_AT:], acknowledged, _CLOCKS[clock], now_s, flags, source))


def _refusal(payload: bytes) -> MessageError:
    """Return what is wrong with a message that cannot be decoded."""
    try:
        header = unpack_header(payload, Kind.FRAMES, FramesFlags.LAST)
        check_length(payload, _ROWS_AT + _ROW.size * header.rows)
    except MessageError as error:
        return error
    clock = payload[HEADER_BYTES + 8]
    return MessageError("frames in an unknown clock", value=clock, limit="0 (run) or 1 (adapter)")
