"""What a user says of a NatNet server: ``natnet:HOST[:PORT]``, and ``--camera NAME=VALUE``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import IPv4Address

from agvbench.adapters.natnet.channel import COMMAND_PORT, Connection
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.errors import FlagError, OneOf
from agvbench.vehicle.quaternion import Up

_NAMES = ("body", "data_port", "local", "multicast", "rate_hz", "up", "version")
_MAX_PORT = 65_535


@dataclass(frozen=True)
class NatNetOptions:
    """Where a server is, and what is wanted of it.

    ``body`` is the name or the id of the vehicle's rigid body, ``rate_hz`` how many frames [Hz] are wanted (None: all).
    """

    connection: Connection
    body: str
    up: Up = "y"
    rate_hz: float | None = None

    @classmethod
    def parse(cls, address: str, camera: Mapping[str, str | float], vehicle: str) -> NatNetOptions:
        """Return what `address` and the camera options say; the body is called as the vehicle is unless they say so.

        Raises
        ------
        FlagError
            If an option is unknown, or its value cannot be.
        """
        for name in camera:
            if name not in _NAMES:
                raise FlagError("not an option of a NatNet camera", where="--camera", value=name, limit=OneOf(_NAMES))
        host, _, port = address.partition(":")
        if not host:
            raise FlagError("NatNet server has no address", where="natnet", remedy="write natnet:HOST")
        version = str(camera["version"]) if "version" in camera else None
        connection = Connection(
            host,
            _port(port or COMMAND_PORT, f"natnet:{address}"),
            str(camera.get("local", "")),
            None if version is None else Version.parse(version),
            group=multicast_group(str(camera["multicast"]), "--camera multicast") if "multicast" in camera else None,
            data_port=_port(camera["data_port"], "--camera data_port") if "data_port" in camera else None,
        )
        body, up, rate_hz = camera.get("body", vehicle), camera.get("up", "y"), camera.get("rate_hz")
        return cls(connection, f"{body:g}" if isinstance(body, float) else body, _up(up), _rate(rate_hz))


def multicast_group(text: str, where: str) -> str:
    """Return the address of a multicast group as it is.

    Raises
    ------
    FlagError
        If it is none.
    """
    try:
        if IPv4Address(text).is_multicast:
            return text
    except ValueError:
        pass
    raise FlagError("not a multicast group", where=where, value=text, limit="224.0.0.0 to 239.255.255.255")


def _port(value: str | float, where: str) -> int:
    try:
        port = int(value)
    except (ValueError, OverflowError):
        port = 0
    if not 1 <= port <= _MAX_PORT:
        raise FlagError("port is out of range", where=where, value=value, limit=f"1 to {_MAX_PORT}")
    return port


def _up(value: str | float) -> Up:
    if value == "y":
        return "y"
    if value == "z":
        return "z"
    raise FlagError("unknown vertical axis", where="--camera up", value=value, limit="y or z, as in Motive's settings")


def _rate(value: str | float | None) -> float | None:
    if value is None:
        return None
    try:
        rate_hz = float(value)
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 10_000.0:
        raise FlagError("frame rate is out of range", where="--camera rate_hz", value=value, limit="1 to 10000 Hz")
    return rate_hz
