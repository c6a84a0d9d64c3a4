"""Zenoh sessions that find nobody by themselves: endpoints are named, scouting is off, loopback is the default.

A session that only connects to one endpoint is a Zenoh client, so that the session it connects to passes messages
on between all its clients; every other session is a peer.
"""

from __future__ import annotations

import ipaddress
import json
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from agvbench.bus.wire import MAX_MESSAGE_BYTES
from agvbench.errors import LinkError

if TYPE_CHECKING:
    import zenoh

DEFAULT_PORT = 7447
_ENDPOINT = re.compile(r"(?P<protocol>[a-z]+)/(?P<host>\[[^\]]+\]|[^\s/:\[\]]+):(?P<port>[0-9]{1,5})")
_PROTOCOLS = ("tcp", "tls", "quic")
_LIKELY = f"tcp/HOST:PORT, for example tcp/127.0.0.1:{DEFAULT_PORT}"


def parse_endpoint(endpoint: str, where: str = "endpoint") -> tuple[str, str, int]:
    """Return protocol, host and port of an endpoint.

    >>> parse_endpoint("tcp/127.0.0.1:7447")
    ('tcp', '127.0.0.1', 7447)

    Raises
    ------
    LinkError
        If it is no endpoint, or of a protocol that can lose messages.
    """
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None:
        raise LinkError("not an endpoint", where=where, value=repr(endpoint), remedy=f"write {_LIKELY}")
    protocol, host, port = match["protocol"], match["host"].strip("[]"), int(match["port"])
    if protocol not in _PROTOCOLS:
        raise LinkError(
            "protocol cannot be used", where=f"{where} {endpoint}", value=protocol, limit=" ".join(_PROTOCOLS)
        )
    if not 0 < port < 65536:
        raise LinkError("port is out of range", where=f"{where} {endpoint}", value=port, limit="1 to 65535")
    return protocol, host, port


def is_loopback(host: str) -> bool:
    """Whether `host` can only be reached from this machine.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def open_session(
    *, listen: Sequence[str] = (), connect: Sequence[str] = (), allow_remote: bool = False, timeout_s: float = 5.0
) -> zenoh.Session:
    """Open a session that talks over these endpoints and no others; without any it stays in this process.

    Parameters
    ----------
    listen, connect
        Endpoints to wait on and to call, as ``tcp/127.0.0.1:7447``.
    allow_remote
        Whether other machines may reach the endpoints that are listened on. There is no authentication: whoever
        reaches them can drive the vehicle.
    timeout_s
        How long [s] to try to connect.

    Raises
    ------
    LinkError
        If an endpoint cannot be parsed, listened on or reached, or is open to other machines unasked.
    """
    for endpoint in connect:
        parse_endpoint(endpoint, "connect")
    for endpoint in listen:
        _, host, _ = parse_endpoint(endpoint, "listen")
        if not (allow_remote or is_loopback(host)):
            raise LinkError(
                "would let other machines drive the vehicle",
                where=f"listen {endpoint}",
                value=host,
                limit="127.0.0.1, ::1 or localhost unless remote access is allowed",
                remedy="pass allow_remote=True, on a network that you trust",
            )
    return _open(_config(listen, connect, timeout_s), listen, connect, timeout_s)


def _reason(text: str) -> str:
    """Return what a person can use of Zenoh's message: the system's own words, else what stands before the path."""
    system = re.search(r"([^:\[\]]+) \(os error \d+\)", text)
    return (system[1] if system else text.partition(" at /")[0]).strip()


def _config(listen: Sequence[str], connect: Sequence[str], timeout_s: float) -> dict[str, Any]:
    return {
        "mode": "client" if len(connect) == 1 and not listen else "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": int(timeout_s * 1000),
        "connect/exit_on_failure": True,
        # A vanished machine (no FIN) is noticed within this time; a vanished process at once.
        "transport/link/tx/lease": 3000,
        # How long a flooded receiver may hold up a sender before its connection is given up.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 60_000_000,
        "transport/link/rx/max_message_size": 4 * MAX_MESSAGE_BYTES,
        "transport/shared_memory/enabled": False,
    }


def _open(config: dict[str, Any], listen: Sequence[str], connect: Sequence[str], timeout_s: float) -> zenoh.Session:
    import zenoh

    settings = zenoh.Config()
    for key, value in config.items():
        settings.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        reason = _reason(str(error))
        if connect and "connect" in reason.lower():
            raise LinkError(
                "nobody answers",
                where=f"connect {' '.join(connect)}",
                value=f"tried for {timeout_s:g} s",
                remedy="start the adapter there first, or correct the endpoint",
            ) from None
        where = " ".join([*(f"listen {e}" for e in listen), *(f"connect {e}" for e in connect)])
        raise LinkError("endpoint cannot be used", where=where, value=reason) from None
