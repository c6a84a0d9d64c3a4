"""MODELDEF: what bodies are called. Ids may change between sessions; names are what people give."""

from __future__ import annotations

import struct
from typing import NamedTuple

from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.packet import Cursor
from agvbench.errors import MessageError

_ID = struct.Struct("<i")
_BODY = struct.Struct("<ii3f")
_QUATERNION_BYTES, _FLOAT3_BYTES = 16, 12
_PLATE_BYTES = 4 * (2 + 3 + 144 + 12 + 2)
_MARKER_SET, _RIGID_BODY, _SKELETON, _FORCE_PLATE, _DEVICE, _CAMERA = range(6)


class BodyDescription(NamedTuple):
    """A rigid body: its id in frames, and its name."""

    id: int
    name: str


def decode_descriptions(payload: bytes, version: Version) -> list[BodyDescription]:
    """Return the rigid bodies that a MODELDEF's payload describes.

    Raises
    ------
    MessageError
        If it is cut off, or has something of an unknown kind and no size to pass over it.
    """
    cursor, found = Cursor(payload), []
    for _ in range(cursor.count()):
        (kind,) = cursor.take(_ID)
        end = None
        if version >= (4, 1):
            size = cursor.count()
            end = cursor.at + size
            if size > cursor.left:
                raise MessageError("NatNet packet is cut off", value=f"{len(payload)} B", limit=f"at least {end} B")
        if kind == _RIGID_BODY:
            found.append(_body(cursor, version))
        elif end is None:
            _pass_over(cursor, version, kind)
        if end is not None:
            cursor.at = end
    return found


def _body(cursor: Cursor, version: Version) -> BodyDescription:
    name = cursor.text()
    number, *_ = cursor.take(_BODY)
    if version >= (4, 2):
        cursor.skip(_QUATERNION_BYTES)
    if version >= (3, 0):
        markers = cursor.count()
        cursor.skip((_FLOAT3_BYTES + _ID.size) * markers)
        if version >= (4, 0):
            for _ in range(markers):
                cursor.text()
    return BodyDescription(number, name)


def _pass_over(cursor: Cursor, version: Version, kind: int) -> None:
    """Pass over a description of something else, in versions that say no sizes."""
    if kind == _MARKER_SET:
        cursor.text()
        _texts(cursor)
    elif kind == _SKELETON:
        cursor.text()
        cursor.skip(_ID.size)
        for _ in range(cursor.count()):
            _body(cursor, version)
    elif kind == _FORCE_PLATE:
        cursor.skip(_ID.size)
        cursor.text()
        cursor.skip(_PLATE_BYTES)
        _texts(cursor)
    elif kind == _DEVICE:
        cursor.skip(_ID.size)
        cursor.text()
        cursor.text()
        cursor.skip(2 * _ID.size)
        _texts(cursor)
    elif kind == _CAMERA:
        cursor.text()
        cursor.skip(_FLOAT3_BYTES + _QUATERNION_BYTES)
    else:
        raise MessageError("NatNet description of an unknown kind", value=kind, limit=f"0 to {_CAMERA}")


def _texts(cursor: Cursor) -> None:
    for _ in range(cursor.count()):
        cursor.text()
