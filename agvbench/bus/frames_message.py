"""The frames message: a batch of motion capture frames in columns.

Body after the header: acknowledged (u64), clock (u8 and 7 bytes of zero), now_s (f64), then the columns
``t_s``, ``x_m``, ``y_m``, ``heading_rad``, ``mean_error_m``, ``received_s`` (f64), ``frame`` (i64),
``tracked`` (u8): 48 bytes and 57 a frame.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from agvbench.bus.wire import MAX_ROWS, Kind, Reader, pack_column, pack_header, unpack_header
from agvbench.errors import MessageError
from agvbench.types import Frames

_BODY = struct.Struct("<QB7xd")


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


@dataclass(frozen=True, slots=True)
class FramesMessage:
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
    data = b"".join(
        (
            pack_header(
                Kind.FRAMES, flags=message.flags, source=message.source, count=count, sequence=message.sequence
            ),
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
    if len(data) != 48 + 57 * count:
        raise MessageError("columns of frames differ in length", value=f"{len(data)} B", limit=f"{48 + 57 * count} B")
    return data


def decode_frames(payload: bytes) -> FramesMessage:
    """Return the message that `payload` holds; its arrays are read-only views.

    Raises
    ------
    MessageError
        If it is not a frames message that this version writes.
    """
    header = unpack_header(payload, Kind.FRAMES, FramesFlags.LAST)
    reader, count = Reader(payload), header.rows
    acknowledged, clock, now_s = reader.fields(_BODY)
    columns = reader.column(6 * count, "<f8").reshape(6, count)
    frame = reader.column(count, "<i8")
    tracked = reader.column(count, "u1")
    reader.finish()
    if clock not in (FrameClock.RUN, FrameClock.ADAPTER):
        raise MessageError("frames in an unknown clock", value=clock, limit="0 (run) or 1 (adapter)")
    if count:
        if not np.isfinite(columns[0]).all():
            raise MessageError("frames without a finite capture time", value=columns[0][~np.isfinite(columns[0])][0])
        if tracked.max() > 1:
            raise MessageError("tracked is neither 0 nor 1", value=int(tracked.max()))
    t_s, x_m, y_m, heading_rad, mean_error_m, received_s = columns
    frames = Frames(t_s, x_m, y_m, heading_rad, tracked.view(np.bool_), frame, mean_error_m, received_s)
    return FramesMessage(
        header.sequence, frames, acknowledged, FrameClock(clock), now_s, FramesFlags(header.flags), header.source
    )
