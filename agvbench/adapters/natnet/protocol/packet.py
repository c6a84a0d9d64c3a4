"""A packet: message, length, payload; and a cursor that reads the payload and never past its end.

Little-endian: u16 message, u16 bytes of payload.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from agvbench.errors import MessageError

HEADER_BYTES = 4
MAX_DATAGRAM_BYTES = 65_535
_HEADER = struct.Struct("<HH")


class Message(IntEnum):
    """What a packet is."""

    CONNECT = 0
    SERVERINFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODELDEF = 4
    MODELDEF = 5
    REQUEST_FRAMEOFDATA = 6
    FRAMEOFDATA = 7
    MESSAGESTRING = 8
    DISCONNECT = 9
    KEEPALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    DISCOVERY = 14
    UNRECOGNIZED = 100


def split(datagram: bytes) -> tuple[int, bytes]:
    """Return a packet's message (`Message` where known) and its payload; bytes behind the payload are ignored.

    Raises
    ------
    MessageError
        If the datagram is shorter than its header says.
    """
    if len(datagram) < HEADER_BYTES:
        raise MessageError("NatNet packet is cut off", value=f"{len(datagram)} B", limit=f"at least {HEADER_BYTES} B")
    message, size = _HEADER.unpack_from(datagram)
    if len(datagram) < HEADER_BYTES + size:
        raise MessageError("NatNet packet is cut off", value=f"{len(datagram)} B", limit=f"{HEADER_BYTES + size} B")
    return message, datagram[HEADER_BYTES : HEADER_BYTES + size]


def join(message: int, payload: bytes = b"") -> bytes:
    """Return the packet's bytes.

    Raises
    ------
    MessageError
        If the payload does not fit a datagram.
    """
    if len(payload) > MAX_DATAGRAM_BYTES - HEADER_BYTES - 28:
        raise MessageError("NatNet packet does not fit a datagram", value=f"{len(payload)} B", limit="65503 B")
    return _HEADER.pack(message, len(payload)) + payload


_COUNT = struct.Struct("<i")
MAX_NAME_BYTES = 4096


class Cursor:
    """Reads little-endian fields one behind another; what is missing is a `MessageError`."""

    __slots__ = ("at", "payload")

    def __init__(self, payload: bytes, at: int = 0) -> None:
        self.payload, self.at = payload, at

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Return the fields that `layout` describes."""
        start = self.at
        self.at = start + layout.size
        if self.at > len(self.payload):
            self._cut_off(self.at)
        return layout.unpack_from(self.payload, start)

    def count(self) -> int:
        """Return a number of things (i32)."""
        count: int = self.take(_COUNT)[0]
        if count < 0:
            raise MessageError("NatNet packet with a negative count", where=f"byte {self.at - 4}", value=count)
        return count

    def skip(self, size: int) -> int:
        """Go on by `size` bytes; return where they begin."""
        start = self.at
        self.at = start + size
        if self.at > len(self.payload):
            self._cut_off(self.at)
        return start

    def rows(self, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return `count` records, read-only, without a copy."""
        return np.frombuffer(self.payload, dtype, count, self.skip(count * dtype.itemsize))

    def text(self) -> str:
        """Return a text that ends with a zero byte."""
        end = self.payload.find(b"\0", self.at, self.at + MAX_NAME_BYTES)
        if end < 0:
            raise MessageError("NatNet name has no end", where=f"byte {self.at}", limit=f"{MAX_NAME_BYTES} B")
        start, self.at = self.at, end + 1
        return self.payload[start:end].decode("utf-8", "replace")

    @property
    def left(self) -> int:
        """How many bytes are left."""
        return len(self.payload) - self.at

    def _cut_off(self, needed: int) -> NoReturn:
        raise MessageError("NatNet packet is cut off", value=f"{len(self.payload)} B", limit=f"at least {needed} B")
