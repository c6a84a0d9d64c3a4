"""SERVERINFO: which server answers a CONNECT, in which version it streams, and how fast its clock ticks."""

from __future__ import annotations

import struct
from typing import NamedTuple

from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.errors import MessageError

_OLD = struct.Struct("<256s4B4B")
_NEW = struct.Struct("<QH?4B")


class ServerInfo(NamedTuple):
    """A server; what versions before 3.0 do not say is None.

    ``clock_hz`` [Hz] is the rate of the ticks in frames and echoes, ``multicast`` the group that frames are sent to,
    or None in unicast.
    """

    application: str
    application_version: str
    version: Version
    clock_hz: int | None = None
    data_port: int | None = None
    multicast: str | None = None


def decode_server_info(payload: bytes) -> ServerInfo:
    """Return what a SERVERINFO says.

    Raises
    ------
    MessageError
        If it is cut off, or its clock stands still.
    """
    if len(payload) < _OLD.size:
        raise MessageError("NatNet server info is cut off", value=f"{len(payload)} B", limit=f"{_OLD.size} B")
    name, *numbers = _OLD.unpack_from(payload)
    info = ServerInfo(
        name.split(b"\0")[0].decode("utf-8", "replace"),
        ".".join(map(str, numbers[:4])),
        Version(numbers[4], numbers[5]),
    )
    if info.version < (3, 0) or len(payload) < _OLD.size + _NEW.size:
        return info
    clock_hz, port, multicast, *address = _NEW.unpack_from(payload, _OLD.size)
    if clock_hz == 0:
        raise MessageError("NatNet server's clock stands still", value="0 Hz", limit="above 0 Hz")
    group = ".".join(map(str, address)) if multicast else None
    return info._replace(clock_hz=clock_hz, data_port=port, multicast=group)


def encode_server_info(info: ServerInfo) -> bytes:
    """Return the payload of a SERVERINFO."""
    application = [int(part) for part in info.application_version.split(".")]
    payload = _OLD.pack(info.application.encode()[:255], *application, info.version.major, info.version.minor, 0, 0)
    if info.version < (3, 0):
        return payload
    address = map(int, info.multicast.split(".")) if info.multicast else (0, 0, 0, 0)
    return payload + _NEW.pack(info.clock_hz or 1, info.data_port or 0, info.multicast is not None, *address)
