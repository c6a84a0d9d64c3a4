"""The frames message: a batch of motion capture frames.

Its field ``columns`` holds ``t_s``, ``x_m``, ``y_m``, ``heading_rad``, ``mean_error_m``, ``received_s`` (f64),
``frame`` (i64) and ``tracked`` (u8) of all frames, little-endian, one column behind another: 57 bytes a frame. A
message with one frame is a row, and the rows of thousands of such messages, which is what a recorder has in real time,
become columns at once.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Annotated, Final

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from agvbench.bus.messages.codec import MAX_ROWS, Message, Number, Source
from agvbench.errors import MessageError
from agvbench.types import Floats, Frames

_FLOAT, _INTEGER, _BOOLEAN = np.dtype("<f8"), np.dtype("<i8"), np.dtype(np.bool_)
_DTYPES = (*[_FLOAT] * 6, _INTEGER, _BOOLEAN)
_FIELDS = ("t_s", "x_m", "y_m", "heading_rad", "mean_error_m", "received_s")
_ROWS = np.dtype([*((name, "<f8") for name in _FIELDS), ("frame", "<i8"), ("tracked", "u1")])
_ROW_BYTES = _ROWS.itemsize
_FRAME_AT, _TRACKED_AT = 48, 56

pack_row = struct.Struct("<6dq?").pack
"""Returns the columns of one frame, from plain numbers: t_s, x_m, y_m, heading_rad, mean_error_m, received_s, frame,
tracked."""


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


class FramesMessage(Message, tag="frames", frozen=True):
    """Frames, and which command had been carried out when they were published.

    ``columns`` are the ``count`` frames as they travel (`pack_columns`, `unpack_columns`); ``acknowledged`` is the
    sequence number of the command (0 in real time), ``now_s`` [s] the publisher's clock when it published.

    Raises
    ------
    MessageError
        If there are more than `MAX_ROWS` frames, or the columns do not hold as many as they should.
    """

    sequence: Number
    count: Number
    columns: bytes
    acknowledged: Number = 0
    clock: FrameClock = FrameClock.RUN
    now_s: float = 0.0
    flags: Annotated[int, Meta(ge=0, le=1)] = FramesFlags.NONE
    source: Source = 0

    def __post_init__(self) -> None:
        if self.count > MAX_ROWS:
            raise MessageError("too many frames for one message", value=self.count, limit=f"at most {MAX_ROWS}")
        if len(self.columns) != _ROW_BYTES * self.count:
            value, limit = f"{len(self.columns)} B", f"{_ROW_BYTES} B × {self.count}"
            raise MessageError("columns of frames do not fit their count", value=value, limit=limit)

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
    # Spelled out, since loops over columns take longer than all the rest.
    columns = (
        frames.t_s, frames.x_m, frames.y_m, frames.heading_rad, frames.mean_error_m, frames.received_s,
        frames.frame, frames.tracked,
    )  # fmt: skip
    if len({column.size for column in columns}) > 1:
        raise MessageError("columns of frames differ in length", value=[column.size for column in columns])
    return b"".join(map(np.ascontiguousarray, columns, _DTYPES))  # type: ignore[arg-type,unused-ignore]  # (arrays are buffers)


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
    floats = np.frombuffer(part, _FLOAT, 6 * count).reshape(6, count)
    return (
        floats,
        np.frombuffer(part, _INTEGER, count, _FRAME_AT * count),
        np.frombuffer(part, np.uint8, count, _TRACKED_AT * count),
    )
