"""Zenoh sessions without discovery: endpoints are named, scouting is off, loopback is the default.

A session that only connects to one endpoint is a Zenoh client, so that the session it connects to passes messages
on between all its clients; every other session is a peer.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from agvbench.bus.bus_config import BusConfig
from agvbench.bus.certificates import why_not
from agvbench.bus.messages.codec import MAX_MESSAGE_BYTES
from agvbench.errors import LinkError, OneOf
from agvbench.loopback import is_loopback

if TYPE_CHECKING:
    import zenoh

DEFAULT_PORT = 7447
_ENDPOINT = re.compile(r"(?P<protocol>[a-z]+)/(?P<host>\[[^\]]+\]|[^\s/:\[\]]+):(?P<port>[0-9]{1,5})")
_PROTOCOLS = ("tcp", "tls", "quic")
_SECURED = ("tls", "quic")
_ENVELOPE_BYTES = 4096
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
        raise LinkError("protocol cannot be used", where=f"{where} {endpoint}", value=protocol, limit=OneOf(_PROTOCOLS))
    if not 0 < port < 65536:
        raise LinkError("port is out of range", where=f"{where} {endpoint}", value=port, limit="1 to 65535")
    return protocol, host, port


def is_open_to_all(endpoint: str, config: BusConfig | None = None, where: str = "listen") -> bool:
    """Whether other machines reach an endpoint that is listened on, and need no certificate.

    >>> is_open_to_all("tcp/0.0.0.0:7447"), is_open_to_all("tcp/127.0.0.1:7447")
    (True, False)
    """
    protocol, host, _ = parse_endpoint(endpoint, where)
    return not (is_loopback(host) or (protocol in _SECURED and config is not None and config.requires_certificate))


def open_bus_session(
    *,
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    allow_remote: bool = False,
    timeout_s: float = 5.0,
    config: BusConfig | None = None,
) -> zenoh.Session:
    """Open a session that talks over these endpoints and no others; without any it stays in this process.

    Parameters
    ----------
    listen, connect
        Endpoints to wait on and to call, as ``tcp/127.0.0.1:7447``.
    allow_remote
        Whether other machines may reach endpoints that require no certificate: each of them can then drive the vehicle.
    timeout_s
        How long [s] to try to connect.
    config
        The lab's certificates and rules; endpoints of TLS and QUIC need one.

    Raises
    ------
    LinkError
        If an endpoint cannot be parsed, listened on or reached, or is open to other machines unasked.
    """
    for where, endpoint in [*(("connect", one) for one in connect), *(("listen", one) for one in listen)]:
        protocol, host, _ = parse_endpoint(endpoint, where)
        if protocol in _SECURED and config is None:
            raise LinkError(
                "needs certificates", where=f"{where} {endpoint}", remedy="name them with --bus-config FILE"
            )
        if where == "listen" and not allow_remote and is_open_to_all(endpoint, config):
            raise LinkError(
                "would let other machines drive the vehicle",
                where=f"listen {endpoint}",
                value=host,
                limit="127.0.0.1, ::1 or localhost unless remote access is allowed",
                remedy="pass allow_remote=True, on a network that you trust",
            )
    return _open(_settings(listen, connect, timeout_s), listen, connect, timeout_s, config)


@contextmanager
def bus_session(
    *,
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    allow_remote: bool = False,
    timeout_s: float = 5.0,
    config: BusConfig | None = None,
) -> Iterator[zenoh.Session]:
    """Open a session (`open_bus_session`) while the context lasts, and close it also where a receiver takes nothing.

    Zenoh waits up to 10 s for a message that a receiver does not take, and then gives the session up with an error. The
    limit is a constant of Zenoh: neither its configuration nor its Python interface has a setting for it
    (``wait_before_close`` ends the senders' wait only), and a shorter one of ours would lose what a slow receiver is
    still taking.

    Raises
    ------
    LinkError
        As `open_bus_session`.
    """
    import zenoh

    session = open_bus_session(
        listen=listen, connect=connect, allow_remote=allow_remote, timeout_s=timeout_s, config=config
    )
    try:
        yield session
    finally:
        with suppress(zenoh.ZError, RuntimeError):  # RuntimeError: another thread is sending
            session.close()  # type: ignore[no-untyped-call]


def _reason(text: str) -> str:
    """Return what a person can use of Zenoh's message: the system's own words, else what stands before the path."""
    system = re.search(r"([^:\[\]]+) \(os error \d+\)", text)
    return (system[1] if system else text.partition(" at /")[0]).strip()


def _settings(listen: Sequence[str], connect: Sequence[str], timeout_s: float) -> dict[str, Any]:
    return {
        "mode": "client" if len(connect) == 1 and not listen else "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": int(timeout_s * 1000),
        "connect/exit_on_failure": True,
        # By default the time between two attempts grows to 4 s: a bench that begins meanwhile would be joined so late.
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 500, "period_increase_factor": 1.5},
        # A vanished machine (no FIN) is noticed within this time; a vanished process at once.
        "transport/link/tx/lease": 3000,
        # How long a flooded receiver may hold up a sender before its connection is given up.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 60_000_000,
        # Connections that never identify themselves must not lock out those that do: as many as wait, each for so long.
        "transport/unicast/accept_pending": 1000,
        "transport/unicast/accept_timeout": 1000,
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES + _ENVELOPE_BYTES,
        "transport/shared_memory/enabled": False,
    }


def _open(
    ours: dict[str, Any], listen: Sequence[str], connect: Sequence[str], timeout_s: float, config: BusConfig | None
) -> zenoh.Session:
    import zenoh

    settings = zenoh.Config() if config is None else config.settings()
    for key, value in ours.items():
        settings.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        reason = _reason(str(error))
        if connect and "connect" in reason.lower():
            raise _no_answer(connect, timeout_s, config) from None
        where = " ".join([*(f"listen {e}" for e in listen), *(f"connect {e}" for e in connect)])
        raise LinkError("endpoint cannot be used", where=where, value=reason) from None


def _no_answer(connect: Sequence[str], timeout_s: float, config: BusConfig | None) -> LinkError:
    """Return why a session could not connect, as far as that can be found out."""
    for endpoint in connect:
        protocol, host, port = parse_endpoint(endpoint, "connect")
        if protocol == "tls" and config is not None and (reason := why_not(config.certificates, host, port)):
            return LinkError(
                "refused", where=f"connect {endpoint}", value=reason,
                remedy=f"see the certificates of both ends; here {config.path}",
            )  # fmt: skip
    return LinkError(
        "no answer",
        where=f"connect {' '.join(connect)}",
        value=f"tried for {timeout_s:g} s",
        remedy="start the adapter there first, or correct the endpoint",
    )
