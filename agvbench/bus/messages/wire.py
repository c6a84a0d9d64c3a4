"""What all messages share: a header of 24 bytes, little-endian, and a reader that checks every step.

=======  ======  ==========================================================================
offset   type    meaning
=======  ======  ==========================================================================
0        4 s     magic, ``AGVB``
4        u8      version of the encoding, 3
5        u8      kind of message (`Kind`)
6        u16     flags, by kind
8        u32     source: drawn by the sender when it starts, so that a restart is not a loss
12       u32     count of rows in the body
16       u64     sequence number of the sender for this key, from 1 without gaps
=======  ======  ==========================================================================
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import MessageError

MAGIC = b"AGVB"
VERSION = 3
MAX_ROWS = 8192
MAX_TEXT_BYTES = 4096
MAX_MESSAGE_BYTES = 1 << 20

FLOAT, INTEGER, BOOLEAN = np.dtype("<f8"), np.dtype("<i8"), np.dtype(np.bool_)
"""What columns are made of."""

_HEADER = struct.Struct("<4sBBHIIQ")
HEADER_BYTES = _HEADER.size
_LENGTH = struct.Struct("<H")


class Kind(IntEnum):
    """What a message is."""

    COMMAND = 1
    FRAMES = 2
    EVENT = 3
    RESET = 4
    SAMPLING = 5
    REPLAY = 6
    AGV_IDENTITY = 7
    MOCAP_IDENTITY = 8
    TIME = 9
    TRUTH = 10
    CLAIM = 11


class Header(NamedTuple):
    """The first 24 bytes of a message, without magic and version."""

    kind: int
    flags: int
    source: int
    rows: int
    sequence: int


def prefix(kind: Kind) -> bytes:
    """Return the first six bytes of every message of `kind`: magic, version, kind."""
    return MAGIC + bytes([VERSION, kind])


def pack_header(kind: Kind, flags: int = 0, source: int = 0, count: int = 0, sequence: int = 0) -> bytes:
    """Return the header's bytes."""
    return _HEADER.pack(MAGIC, VERSION, kind, flags, source, count, sequence)


def unpack_header(payload: bytes, kind: Kind, known_flags: int = 0) -> Header:
    """Return the header of a message that should be of `kind`.

    Raises
    ------
    MessageError
        If length, magic, version, kind, flags or count are not what this version writes.
    """
    if len(payload) > MAX_MESSAGE_BYTES:
        raise MessageError("message is too long", value=f"{len(payload)} B", limit=f"at most {MAX_MESSAGE_BYTES} B")
    if len(payload) < HEADER_BYTES:
        raise MessageError("message is cut off", value=f"{len(payload)} B", limit=f"at least {HEADER_BYTES} B")
    magic, version, found, flags, source, count, sequence = _HEADER.unpack_from(payload)
    if magic != MAGIC:
        raise MessageError("not an agvbench message", value=f"first bytes {magic!r}", limit=f"{MAGIC!r}")
    if version != VERSION:
        raise MessageError(
            "message of another version", value=version, limit=VERSION, remedy="install the same agvbench on both ends"
        )
    if found != kind:
        raise MessageError("message of another kind", value=found, limit=f"{kind.value} ({kind.name.lower()})")
    if flags & ~known_flags:
        raise MessageError("message with unknown flags", value=f"{flags:#06x}", limit=f"{known_flags:#06x}")
    if count > MAX_ROWS:
        raise MessageError("message has too many rows", value=count, limit=f"at most {MAX_ROWS}")
    return Header(found, flags, source, count, sequence)


def check_length(payload: bytes, expected: int) -> None:
    """Raise `MessageError` unless the message is exactly `expected` bytes long."""
    if len(payload) < expected:
        raise MessageError("message is cut off", value=f"{len(payload)} B", limit=f"{expected} B")
    if len(payload) > expected:
        raise MessageError("message is longer than its count says", value=f"{len(payload)} B", limit=f"{expected} B")


def pack_text(text: str) -> bytes:
    """Return a text as UTF-8 behind its length (u16).

    Raises
    ------
    MessageError
        If it takes more than 4096 bytes.
    """
    data = text.encode("utf-8", "replace")
    if len(data) > MAX_TEXT_BYTES:
        raise MessageError("text is too long to send", value=f"{len(data)} B", limit=f"at most {MAX_TEXT_BYTES} B")
    return _LENGTH.pack(len(data)) + data


def pack_column(values: NDArray[Any], dtype: np.dtype[Any]) -> bytes:
    """Return one column as little-endian bytes."""
    return values.tobytes() if values.dtype is dtype else np.asarray(values, dtype).tobytes()


class Reader:
    """Takes a message's body apart from front to back; what is missing or left over is a `MessageError`."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._at = HEADER_BYTES

    def _skip(self, size: int) -> int:
        start, self._at = self._at, self._at + size
        if self._at > len(self._payload):
            check_length(self._payload, self._at)
        return start

    def fields(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Return the numbers that `layout` describes."""
        return layout.unpack_from(self._payload, self._skip(layout.size))

    def text(self) -> str:
        """Return a text behind its length."""
        (size,) = self.fields(_LENGTH)
        if size > MAX_TEXT_BYTES:
            raise MessageError("text is too long", value=f"{size} B", limit=f"at most {MAX_TEXT_BYTES} B")
        start = self._skip(size)
        try:
            return self._payload[start : start + size].decode("utf-8")
        except UnicodeDecodeError as error:
            raise MessageError("text is not UTF-8", value=error.reason) from None

    def column(self, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return `count` values, read-only, without a copy."""
        start = self._skip(count * dtype.itemsize)
        return np.frombuffer(self._payload, dtype, count, start)

    def finish(self) -> None:
        """Complain if anything is left."""
        check_length(self._payload, self._at)
