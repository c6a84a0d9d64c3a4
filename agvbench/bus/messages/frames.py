"""The frames message: a batch of motion capture frames, a row each.

Body after the header: acknowledged (u64), clock (u8 and 7 bytes of zero), now_s (f64), then the columns ``t_s``,
``x_m``, ``y_m``, ``heading_rad``, ``mean_error_m``, ``received_s`` (f64), ``frame`` (i64), ``tracked`` (u8), one behind
another: 48 bytes and 57 a frame. A message with one frame is a row, and the rows of thousands of such messages, which
is what a recorder has in real time, become columns at once.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.bus.messages.wire import (
    BOOLEAN,
    FLOAT,
    HEADER_BYTES,
    INTEGER,
    MAX_ROWS,
    Kind,
    check_length,
    prefix,
    unpack_header,
)
from agvbench.errors import MessageError
from agvbench.types import Floats, Frames

# Header and body in one: a process that has just been woken pays for every Python call tenfold.
_HEAD = struct.Struct("<6sHIIQQB7xd")
_PREFIX = prefix(Kind.FRAMES)
# Bound once, and named tuples without their Python constructor, for the same reason.
_pack, _unpack, _tuple, _join = _HEAD.pack, _HEAD.unpack_from, tuple.__new__, b"".join
_ROWS_AT = _HEAD.size
_FIELDS = ("t_s", "x_m", "y_m", "heading_rad", "mean_error_m", "received_s")
_ROWS = np.dtype([*((name, "<f8") for name in _FIELDS), ("frame", "<i8"), ("tracked", "u1")])
_ROW_BYTES = _ROWS.itemsize
_DTYPES = (*[FLOAT] * 6, INTEGER, BOOLEAN)
_FRAME_AT, _TRACKED_AT = 48, 56


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


_LAST = FramesFlags.LAST
pack_single = partial(struct.Struct(_HEAD.format + "6dq?").pack, _PREFIX, _LAST)
"""Returns the bytes of a last message with one frame, from plain numbers: source, 1 (frame), sequence, acknowledged,
clock, now_s, t_s, x_m, y_m, heading_rad, mean_error_m, received_s, frame, tracked."""
_CLOCKS = tuple(FrameClock)
_LATEST_CLOCK = max(FrameClock).value


class FramesMessage(NamedTuple):
    """Frames, and which command had been carried out when they were published.

    ``columns`` are the frames as they travel (`pack_columns`, `unpack_columns`); ``acknowledged`` is the sequence
    number of the command (0 in real time), ``now_s`` [s] the publisher's clock when it published.
    """

    sequence: int
    columns: bytes
    acknowledged: int = 0
    clock: FrameClock = FrameClock.RUN
    now_s: float = 0.0
    flags: int = FramesFlags.NONE
    source: int = 0

    @property
    def frame_count(self) -> int:
        """How many frames there are."""
        return len(self.columns) // _ROW_BYTES

    def frames(self) -> Frames:
        """Return the frames, or raise `MessageError` if their numbers cannot be."""
        return unpack_columns([self.columns])


def pack_columns(frames: Frames) -> bytes:
    """Return frames as they travel.

    Raises
    ------
    MessageError
        If columns differ in length.
    """
    return _append_columns(b"", frames)


def _append_columns(head: bytes, frames: Frames) -> bytes:
    """Return `head` and behind it the columns, copied once."""
    t_s, x_m, y_m, heading_rad = frames.t_s, frames.x_m, frames.y_m, frames.heading_rad
    error_m, received_s, frame, tracked = frames.mean_error_m, frames.received_s, frames.frame, frames.tracked
    columns = (t_s, x_m, y_m, heading_rad, error_m, received_s, frame, tracked)
    # Spelled out, since loops over columns take longer than all the rest.
    count = t_s.size
    if not (
        count == x_m.size == y_m.size == heading_rad.size == error_m.size == received_s.size
        and count == frame.size == tracked.size
    ):
        raise MessageError("columns of frames differ in length", value=[column.size for column in columns])
    if (
        FLOAT is t_s.dtype is x_m.dtype is y_m.dtype is heading_rad.dtype is error_m.dtype is received_s.dtype
        and frame.dtype is INTEGER
        and tracked.dtype is BOOLEAN
    ):
        try:
            return _join((head, *columns))  # type: ignore[arg-type]  # (arrays are buffers)
        except TypeError:
            pass  # a column whose values do not lie side by side is no buffer
    return head + _join(np.asarray(column, dtype).tobytes() for column, dtype in zip(columns, _DTYPES, strict=True))


def unpack_columns(parts: Sequence[bytes]) -> Frames:
    """Return the frames of several messages, one behind another.

    Raises
    ------
    MessageError
        If a capture time is not finite, or ``tracked`` neither 0 nor 1.
    """
    if len(parts) == 1:
        floats, frame, tracked = _columns(parts[0])
    elif all(len(part) == _ROW_BYTES for part in parts):
        rows = np.frombuffer(b"".join(parts), _ROWS)
        floats = np.array([rows[name] for name in _FIELDS])
        frame, tracked = np.ascontiguousarray(rows["frame"]), np.ascontiguousarray(rows["tracked"])
    else:
        floats, frame, tracked = (np.concatenate(column, -1) for column in zip(*map(_columns, parts), strict=True))
    t_s, x_m, y_m, heading_rad, mean_error_m, received_s = floats
    if not np.isfinite(t_s).all():
        raise MessageError("frames without a finite capture time", value=float(t_s[~np.isfinite(t_s)][0]))
    if tracked.tobytes().strip(b"\0\1"):
        raise MessageError("tracked is neither 0 nor 1", value=int(tracked.max()))
    return Frames(t_s, x_m, y_m, heading_rad, tracked.view(np.bool_), frame, mean_error_m, received_s)


def _columns(part: bytes) -> tuple[Floats, NDArray[np.int64], NDArray[np.uint8]]:
    """Return one message's columns of floats, shape (6, n), its frame numbers and what was tracked, without a copy."""
    count = len(part) // _ROW_BYTES
    floats = np.frombuffer(part, FLOAT, 6 * count).reshape(6, count)
    return (
        floats,
        np.frombuffer(part, INTEGER, count, _FRAME_AT * count),
        np.frombuffer(part, np.uint8, count, _TRACKED_AT * count),
    )


def pack_frames(
    sequence: int, columns: bytes, acknowledged: int, clock: FrameClock, now_s: float, flags: int, source: int
) -> bytes:
    """Return the bytes of a message with these fields, see `FramesMessage`.

    Raises
    ------
    MessageError
        If there are more than `MAX_ROWS` frames.
    """
    count = len(columns) // _ROW_BYTES
    if count > MAX_ROWS:
        raise _too_many(count)
    return _pack(_PREFIX, flags, source, count, sequence, acknowledged, clock, now_s) + columns


def pack_batch(
    sequence: int, frames: Frames, acknowledged: int, clock: FrameClock, now_s: float, flags: int, source: int
) -> bytes:
    """Return what `pack_frames` would of the frames' columns, which are copied only once.

    Raises
    ------
    MessageError
        If columns differ in length, or there are more than `MAX_ROWS` frames.
    """
    count = len(frames.t_s)
    if count > MAX_ROWS:
        raise _too_many(count)
    head = _pack(_PREFIX, flags, source, count, sequence, acknowledged, clock, now_s)
    return _append_columns(head, frames)


def encode_frames(message: FramesMessage) -> bytes:
    """Return the message's bytes, or raise as `pack_frames`."""
    return pack_frames(*message)


def decode_frames(payload: bytes) -> FramesMessage:
    """Return the message that `payload` holds; its columns are looked at by `unpack_columns`.

    Raises
    ------
    MessageError
        If it is not a frames message that this version writes.
    """
    if len(payload) < _ROWS_AT:
        raise _refusal(payload)
    found, flags, source, count, sequence, acknowledged, clock, now_s = _unpack(payload)
    if (
        found != _PREFIX
        or len(payload) != _ROWS_AT + _ROW_BYTES * count
        or flags > _LAST
        or count > MAX_ROWS
        or clock > _LATEST_CLOCK
    ):
        raise _refusal(payload)
    return _tuple(FramesMessage, (sequence, payload[_ROWS_AT:], acknowledged, _CLOCKS[clock], now_s, flags, source))


def _too_many(count: int) -> MessageError:
    return MessageError("too many frames for one message", value=count, limit=f"at most {MAX_ROWS}")


def _refusal(payload: bytes) -> MessageError:
    """Return what is wrong with a message that cannot be decoded."""
    try:
        header = unpack_header(payload, Kind.FRAMES, FramesFlags.LAST)
        check_length(payload, _ROWS_AT + _ROW_BYTES * header.rows)
    except MessageError as error:
        return error
    clock = payload[HEADER_BYTES + 8]
    return MessageError("frames in an unknown clock", value=clock, limit="0 (run) or 1 (adapter)")
