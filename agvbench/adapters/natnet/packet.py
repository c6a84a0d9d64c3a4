"""A packet: two bytes that say what it is, two that say how much follows, and that.

Little-endian: u16 message, u16 bytes of payload.
"""

from __future__ import annotations

import struct
from enum import IntEnum

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
