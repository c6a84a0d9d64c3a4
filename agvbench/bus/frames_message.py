"""The frames message: a batch of motion capture frames in columns.

Body after the header: acknowledged (u64), clock (u8 and 7 bytes of zero), now_s (f64), then the columns
``t_s``, ``x_m``, ``y_m``, ``heading_rad``, ``mean_error_m``, ``received_s`` (f64), ``frame`` (i64),
``tracked`` (u8): 48 bytes and 57 a frame.
"""

from __future__ import annotations

import struct
from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np

from agvbench.bus.wire import HEADER_BYTES, MAX_ROWS, Kind, check_length, pack_column, pack_header, unpack_header
from agvbench.errors import MessageError
from agvbench.types import Frames

_BODY = struct.Struct("<QB7xd")
_COLUMNS_AT = HEADER_BYTES + _BODY.size
_ROW_BYTES = 57


class FrameClock(IntEnum):
    """Which clock the time stamps of frames are in."""

    RUN = 0
    """The run's: 0 is its first command. Only a simulation in lock step knows it."""
    ADAPTER = 1
    """The mocap adapter's own; the link brings it into the run's."""


class FramesFlags(IntFlag):
    """What else a frames message says."""

    NONE = 0
    LAST = 1
    """The last message that answers the acknowledged command."""


# Plain tables, since arithmetic with flags takes longer than everything else here.
_CLOCKS = {int(clock): clock for clock in FrameClock}
_FLAGS = {0: FramesFlags.NONE, 1: FramesFlags.LAST}
_KNOWN = 1


class FramesMessage(NamedTuple):
    """Frames, and which command had been carried out when they were published.

    ``acknowledged`` is the sequence number of that command (0 in real time), ``now_s`` [s] the publisher's
    clock when it published.
    """

    sequence: int
    frames: Frames
    acknowledged: int = 0
    clock: FrameClock = FrameClock.RUN
    now_s: float = 0.0
    flags: FramesFlags = FramesFlags.NONE
    source: int = 0


def encode_frames(message: FramesMessage) -> bytes:
    """Return the message's bytes.

    Raises
    ------
    MessageError
        If there are more than `MAX_ROWS` frames, or columns differ in length.
    """
    frames, count = message.frames, len(message.frames)
    if count > MAX_ROWS:
        raise MessageError("too many frames for one message", value=count, limit=f"at most {MAX_ROWS}")
    flags = int(message.flags)
    data = b"".join(
        (
            pack_header(Kind.FRAMES, flags=flags, source=message.source, count=count, sequence=message.sequence),
            _BODY.pack(message.acknowledged, message.clock, message.now_s),
            pack_column(frames.t_s, "<f8"),
            pack_column(frames.x_m, "<f8"),
            pack_column(frames.y_m, "<f8"),
            pack_column(frames.heading_rad, "<f8"),
            pack_column(frames.mean_error_m, "<f8"),
            pack_column(frames.received_s, "<f8"),
            pack_column(frames.frame, "<i8"),
            pack_column(frames.tracked, "u1"),
        )
    )
    if len(data) != _COLUMNS_AT + _ROW_BYTES * count:
        raise MessageError("columns of frames differ in length", where=f"message of {count} frames")
    return data


def decode_frames(payload: bytes) -> FramesMessage:
    """Return the message that `payload` holds; its arrays are read-only views.

    Raises
    ------
    MessageError
        If it is not a frames message that this version writes.
    """
    # This runs for every frame of every vehicle in real time: no reader, no enum arithmetic, one pass per check.
    header = unpack_header(payload, Kind.FRAMES, _KNOWN)
    count = header.rows
    check_length(payload, _COLUMNS_AT + _ROW_BYTES * count)
    acknowledged, clock, now_s = _BODY.unpack_from(payload, HEADER_BYTES)
    if clock not in _CLOCKS:
        raise MessageError("frames in an unknown clock", value=clock, limit="0 (run) or 1 (adapter)")
    tracked_at = _COLUMNS_AT + 56 * count
    if payload[tracked_at:].translate(None, b"\0\1"):
        raise MessageError("tracked is neither 0 nor 1", value=max(payload[tracked_at:]))
    t_s, x_m, y_m, heading_rad, mean_error_m, received_s = np.frombuffer(
        payload, "<f8", 6 * count, _COLUMNS_AT
    ).reshape(6, count)
    if not np.isfinite(t_s).all():
        raise MessageError("frames without a finite capture time", where=f"message {header.sequence}")
    frames = Frames(
        t_s,
        x_m,
        y_m,
        heading_rad,
        np.frombuffer(payload, np.bool_, count, tracked_at),
        np.frombuffer(payload, "<i8", count, _COLUMNS_AT + 48 * count),
        mean_error_m,
        received_s,
    )
    return FramesMessage(
        header.sequence, frames, acknowledged, _CLOCKS[clock], now_s, _FLAGS[header.flags], header.source
    )
