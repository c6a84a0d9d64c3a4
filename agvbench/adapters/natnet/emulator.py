"""A server that speaks NatNet as Motive does: for tests, rehearsals and demonstrations without cameras.

It answers on a command socket, and sends frames to every client that connected (unicast) or to a group (multicast),
on loopback by default.
"""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from agvbench.adapters.natnet.network_faults import Network, PacketFaults
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.encode import Model, encode_descriptions, encode_frame
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.adapters.natnet.protocol.packet import MAX_DATAGRAM_BYTES, Message, join, split
from agvbench.adapters.natnet.protocol.server_info import ServerInfo, encode_server_info
from agvbench.bus.clock import Clock, WallClock
from agvbench.errors import LinkError, MessageError

CLIENT_LIMIT_S = 10.0
MAX_CLIENTS = 32
_VERSION, _GOOD = Version(4, 1), PacketFaults()
_POLL_S = 0.05
_TICKS = struct.Struct("<Q")
_FLOAT = struct.Struct("<f")
_BITSTREAM = "Bitstream,"

Address = tuple[str, int]


@dataclass(frozen=True)
class Settings:
    """What an emulated server is like.

    ``port`` 0 takes any free one. ``multicast`` is the group that frames go to, None for unicast. The server's clock
    runs at ``clock_hz`` [Hz], faster than the host's by ``drift`` [s/s], and was ahead by ``offset_s`` [s]. The way to
    the clients has the faults ``network``, by chance, which ``seed`` decides on.
    """

    version: Version = _VERSION
    host: str = "127.0.0.1"
    port: int = 0
    multicast: str | None = None
    data_port: int = 0
    rate_hz: float = 120.0
    clock_hz: int = 10_000_000
    drift: float = 0.0
    offset_s: float = 1000.0
    network: PacketFaults = _GOOD
    seed: int = 0


class _Client(NamedTuple):
    heard_s: float
    version: Version


class Emulator:
    """A NatNet server, until `close`; in a thread of its own, or answering in `step` only. ``heard`` counts packets.

    Raises
    ------
    LinkError
        If the port is taken, or the address is not this machine's.
    """

    def __init__(
        self, settings: Settings, models: Sequence[Model], clock: Clock | None = None, *, threaded: bool = True
    ) -> None:
        self.settings, self._models, self._clock = settings, list(models), clock or WallClock()
        self._clients: dict[Address, _Client] = {}
        self._network = Network(settings.network, settings.seed)
        self.heard = 0
        self._lock = threading.Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((settings.host, settings.port))
            if settings.multicast is not None:
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(settings.host))
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        except (OSError, OverflowError) as error:
            self._socket.close()
            where = f"natnet emulator {settings.host}:{settings.port}"
            raise LinkError(
                "address cannot be used", where=where, value=getattr(error, "strerror", None) or error
            ) from None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="natnet-emulator", daemon=True)
        if threaded:
            self._thread.start()

    @property
    def address(self) -> Address:
        """Host and command port."""
        host, port = self._socket.getsockname()
        return host, port

    def ticks(self, host_s: float | None = None) -> int:
        """Return what the server's clock shows when the host's shows `host_s` [s]; now if None."""
        host_s = self._clock.now() if host_s is None else host_s
        return int((host_s * (1.0 + self.settings.drift) + self.settings.offset_s) * self.settings.clock_hz)

    def clients(self) -> list[Address]:
        """Return the addresses of the clients that have connected and were heard of recently."""
        oldest_s = self._clock.now() - CLIENT_LIMIT_S
        with self._lock:
            self._clients = {
                client_address: client for client_address, client in self._clients.items() if client.heard_s >= oldest_s
            }
            return list(self._clients)

    def describe(self, models: Sequence[Model]) -> None:
        """Have other bodies from now on; clients hear of it by a flag of the frames."""
        with self._lock:
            self._models = list(models)

    def send(self, frame: FrameOfData) -> int:
        """Stream a frame; return how many packets went out: a bad network has its own idea of that."""
        if self.settings.multicast is not None:
            targets = [((self.settings.multicast, self.settings.data_port), self.settings.version)]
        else:
            self.clients()
            with self._lock:
                targets = [(client_address, client.version) for client_address, client in self._clients.items()]
        packets = {version: join(Message.FRAMEOFDATA, self._encoded(frame, version)) for _, version in targets}
        sent = [
            (packet, client_address)
            for client_address, version in targets
            for packet in self._network.carry(packets[version])
        ]
        for packet, client_address in sent:
            self._send(packet, client_address)
        return len(sent)

    def _encoded(self, frame: FrameOfData, version: Version) -> bytes:
        return encode_frame(frame, version, self._models)

    def _send(self, packet: bytes, client_address: Address) -> None:
        try:
            self._socket.sendto(packet, client_address)
        except OSError:
            # A client that went away is refused by its own machine: no reason for the others to see nothing.
            return

    def _serve(self) -> None:
        while not self._closed.is_set():
            self.step(_POLL_S)

    def step(self, limit_s: float = 0.0) -> bool:
        """Answer the next packet, waiting up to `limit_s` [s]; return whether there was one."""
        self._socket.settimeout(limit_s)
        try:
            datagram, client_address = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
        except OSError:
            return False
        self.heard += 1
        received_ticks = self.ticks()
        try:
            message, payload = split(datagram)
        except MessageError:
            return True
        if (answer := self._answer(message, payload, client_address, received_ticks)) is not None:
            self._send(answer, client_address)
        return True

    def _answer(self, message: int, payload: bytes, client_address: Address, ticks: int) -> bytes | None:
        self._heard_of(client_address, connects=message == Message.CONNECT)
        if message == Message.CONNECT:
            group, rate = self.settings.multicast, self.settings.clock_hz
            info = ServerInfo("agvbench", "1.0.0.0", self.settings.version, rate, self.settings.data_port, group)
            return join(Message.SERVERINFO, encode_server_info(info))
        if message == Message.REQUEST_MODELDEF:
            return join(Message.MODELDEF, encode_descriptions(self._models, self._version_of(client_address)))
        if message == Message.REQUEST:
            return self._requested(payload.split(b"\0")[0].decode("utf-8", "replace"), client_address)
        if message == Message.ECHO_REQUEST and len(payload) == _TICKS.size:
            return join(Message.ECHO_RESPONSE, payload + _TICKS.pack(ticks))
        if message == Message.DISCONNECT:
            with self._lock:
                self._clients.pop(client_address, None)
        return None if message in {Message.KEEPALIVE, Message.DISCONNECT} else join(Message.UNRECOGNIZED)

    def _heard_of(self, client_address: Address, *, connects: bool) -> None:
        with self._lock:
            client = self._clients.get(client_address)
            if client is not None:
                self._clients[client_address] = client._replace(heard_s=self._clock.now())
            elif connects and len(self._clients) < MAX_CLIENTS:
                self._clients[client_address] = _Client(self._clock.now(), self.settings.version)

    def _version_of(self, client_address: Address) -> Version:
        with self._lock:
            client = self._clients.get(client_address)
        return self.settings.version if client is None else client.version

    def _requested(self, text: str, client_address: Address) -> bytes:
        if text == "FrameRate":
            return join(Message.RESPONSE, _FLOAT.pack(self.settings.rate_hz))
        if text.startswith(_BITSTREAM) and self.settings.version >= (4, 0) and self.settings.multicast is None:
            try:
                version = Version.parse(text.removeprefix(_BITSTREAM))
            except MessageError:
                return join(Message.UNRECOGNIZED)
            with self._lock:
                if client_address in self._clients:
                    self._clients[client_address] = self._clients[client_address]._replace(version=version)
            return join(Message.RESPONSE, f"{text}\0".encode())
        return join(Message.UNRECOGNIZED)

    def close(self) -> None:
        """Stream no more; again does nothing."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._socket.close()
