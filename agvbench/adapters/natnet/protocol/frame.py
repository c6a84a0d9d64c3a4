"""FRAMEOFDATA: where the camera system saw bodies and markers, and when.

Everything but rigid bodies, labelled markers and times is passed over; from version 4.1 on by the size that each
section says, so that sections of versions to come do no harm.
"""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.adapters.natnet.protocol.bitstream import BODY, TRACKED, Layout, Version, layout_of
from agvbench.adapters.natnet.protocol.packet import Cursor
from agvbench.errors import MessageError

_NUMBER = struct.Struct("<i")
_SIZED = struct.Struct("<ii")
_OLD_BODY = struct.Struct("<i7f")
_OLD_END = {False: struct.Struct("<f"), True: struct.Struct("<fh")}
_END_TAG_BYTES = 4
_BARE_TAIL = struct.Struct("<fII")
_FLOAT3_BYTES = 12
_NO_MARKERS: NDArray[Any] = np.empty(0, [("id", "<i4")])
# Which of the sections hold bodies and labelled markers, and how many every version from 4.1 on has.
_BODIES, _LABELLED, _SECTIONS = 2, 5, 8
_tuple = tuple.__new__

RECORDING, MODELS_CHANGED = 1, 2
"""Flags of a frame: the server records; ask for the model definitions again."""


class FrameOfData(NamedTuple):
    """A frame.

    ``bodies`` are records of `agvbench.adapters.natnet.protocol.bitstream.BODY`: position [m] in the server's axes,
    quaternion (x, y, z, w), mean marker error [m]. ``markers`` are the labelled ones, where asked for.
    ``timestamp_s`` [s] counts from when the server began (NaN where 2.5 does not say); ``exposed_ticks`` (mid-
    exposure), ``received_ticks`` and ``transmitted_ticks`` are readings of the server's clock, -1 before version
    3.0.
    """

    number: int
    bodies: NDArray[Any]
    markers: NDArray[Any]
    timestamp_s: float
    exposed_ticks: int
    received_ticks: int
    transmitted_ticks: int
    flags: int

    @property
    def tracked(self) -> NDArray[np.bool_]:
        """Which bodies are tracked, shape (n,)."""
        return (self.bodies["flags"] & TRACKED).astype(np.bool_)


def decode_frame(payload: bytes, version: Version, *, markers: bool = False) -> FrameOfData:
    """Return what a FRAMEOFDATA's payload says.

    Parameters
    ----------
    payload
        The packet without its first four bytes.
    version
        Of the bit stream, see `agvbench.adapters.natnet.protocol.server_info.ServerInfo`.
    markers
        Whether the labelled markers are wanted.

    Raises
    ------
    MessageError
        If the payload ends early, or says that something has a negative size.
    """
    layout = layout_of(version)
    cursor = Cursor(payload)
    number = cursor.take(_NUMBER)[0]
    if layout.sized:
        bodies, found = _sized_sections(cursor, layout, markers)
    else:
        bodies, found = _unsized_sections(cursor, layout, version, markers)
    if version < (2, 6) and cursor.left < layout.tail.size + _END_TAG_BYTES:
        cursor.take(_BARE_TAIL)
        return FrameOfData(number, bodies, found, math.nan, -1, -1, -1, 0)
    tail = cursor.take(layout.tail)
    if layout.bodies_with_markers:
        return FrameOfData(number, bodies, found, tail[3], -1, -1, -1, tail[-1])
    return _tuple(FrameOfData, (number, bodies, found, tail[2], tail[3], tail[4], tail[5], tail[-1]))


def _sized_sections(cursor: Cursor, layout: Layout, markers: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return bodies and labelled markers; everything else is passed over by its size.

    The order is marker sets, other markers, rigid bodies, skeletons, assets, labelled markers, force plates, devices,
    and whatever a later version puts there.
    """
    payload, at, found = cursor.payload, cursor.at, _NO_MARKERS
    end = len(payload) - layout.tail.size - _END_TAG_BYTES
    bodies: NDArray[Any] | None = None
    section, unpack = 0, _SIZED.unpack_from
    while at + _SIZED.size <= end:
        count, size = unpack(payload, at)
        at += _SIZED.size
        if count < 0 or not 0 <= size <= end - at:
            if section >= _SECTIONS:
                at -= _SIZED.size  # what follows is no section, but bytes behind the frame
                break
            raise MessageError("NatNet section does not fit", where=f"byte {at}", value=f"{count} in {size} B")
        if section == _BODIES:
            bodies = _records(payload, at, count, size, BODY)
        elif section == _LABELLED and markers:
            found = _records(payload, at, count, size, layout.marker)
        at += size
        section += 1
    if section < _SECTIONS or bodies is None:
        raise MessageError("NatNet frame is cut off", value=f"{section} sections", limit=f"at least {_SECTIONS}")
    cursor.at = at
    return bodies, found


def _records(payload: bytes, at: int, count: int, size: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the records of a section that says its size; those of a version to come may be longer."""
    if count * dtype.itemsize == size:
        return np.frombuffer(payload, dtype, count, at)
    if count == 0 or size % count or size // count < dtype.itemsize:
        raise MessageError("NatNet section does not fit", where=f"byte {at}", value=f"{count} in {size} B")
    return np.ndarray((count,), dtype, payload, at, (size // count,))


def _unsized_sections(
    cursor: Cursor, layout: Layout, version: Version, markers: bool
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return bodies and labelled markers of a version that says no sizes: every section has to be walked through."""
    for _ in range(cursor.count()):
        cursor.text()
        cursor.skip(_FLOAT3_BYTES * cursor.count())
    cursor.skip(_FLOAT3_BYTES * cursor.count())
    bodies, found = _bodies(cursor, layout), _NO_MARKERS
    for _ in range(cursor.count()):
        cursor.skip(_NUMBER.size)
        _bodies(cursor, layout)
    if version >= (2, 3):
        found = cursor.rows(cursor.count(), layout.marker)
    for _ in range(layout.plates):
        for _ in range(cursor.count()):
            _skip_channels(cursor)
    return bodies, found if markers else _NO_MARKERS


def _skip_channels(cursor: Cursor) -> None:
    """Pass over a force plate or a device: its id, and a row of numbers for each channel."""
    cursor.skip(_NUMBER.size)
    for _ in range(cursor.count()):
        cursor.skip(4 * cursor.count())


def _bodies(cursor: Cursor, layout: Layout) -> NDArray[Any]:
    """Return the rigid bodies of a section without a size."""
    count = cursor.count()
    if not layout.bodies_with_markers:
        return cursor.rows(count, BODY)
    end, rows = _OLD_END[layout.body_flags], []
    for _ in range(count):
        body = cursor.take(_OLD_BODY)
        cursor.skip((_FLOAT3_BYTES + 8) * cursor.count())  # positions, ids and sizes of its markers
        mean_error_m, *flags = cursor.take(end)
        # Before 2.6 nothing says whether a body is tracked: it is, unless its orientation is none.
        flag = flags[0] if flags else TRACKED * any(body[4:])
        rows.append((body[0], body[1:4], body[4:], mean_error_m, flag))
    return np.array(rows, BODY)
