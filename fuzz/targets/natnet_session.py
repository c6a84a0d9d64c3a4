"""Both ends of a NatNet session after their handshake: a client that hears anything, a server that is asked anything.

The first byte of an input chooses the version of the stream, the rest is a datagram. What client and server remember
from one to the next (names, clocks, clients) stays small, or the fuzzer's memory limit ends it.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable

from fuzz.natnet_samples import VERSIONS, packets
from fuzz.target import Target

_CLIENT = ("127.0.0.1", 50_000)
_PORTS = 64


class NatNetSession(Target):
    """A version and a datagram, to a client and to an emulated server."""

    name = "natnet_session"
    instruments = ("agvbench.adapters.natnet",)

    def __init__(self) -> None:
        from agvbench.adapters.natnet.channel import Connection
        from agvbench.adapters.natnet.client import Client, Seen
        from agvbench.adapters.natnet.emulator import Emulator, Settings
        from agvbench.adapters.natnet.protocol.bitstream import Version
        from agvbench.adapters.natnet.protocol.encode import Model
        from agvbench.adapters.natnet.protocol.packet import split
        from agvbench.bus.clock import WallClock

        def seen(one: Seen) -> None:
            assert math.isfinite(one.captured.time_s)

        self._split, self._versions = split, [Version(*version) for version in VERSIONS]
        self._server = Emulator(Settings(), [Model(1, "agv1")], threaded=False)
        done = threading.Event()
        thread = threading.Thread(target=lambda: [self._server.step(0.01) for _ in iter(done.is_set, True)])
        thread.start()
        host, port = self._server.address
        self._client = Client(Connection(host, port, host), WallClock(), seen)
        done.set()
        thread.join()

    def seeds(self) -> Iterable[bytes]:
        """Return packets of each kind in each version, and what clients ask."""
        for index, version in enumerate(VERSIONS):
            for packet in packets(version):
                yield bytes([index]) + packet
        yield b"\0\0\0\5\0Ping\0"
        yield b"\0\4\0\0\0"
        yield b"\0\x0c\0\x08\0" + bytes(8)

    def feed(self, data: bytes) -> None:
        """Give the datagram to both ends, as the threads that receive do."""
        if not data:
            return
        version = self._client.version = self._versions[data[0] % len(self._versions)]
        message, payload = self._split(data[1:])
        self._server._answer(message, payload, (_CLIENT[0], _CLIENT[1] + len(data) % _PORTS), 0)
        assert len(self._server.clients()) <= _PORTS
        self._client.version = version
        self._client._take(message, payload)
