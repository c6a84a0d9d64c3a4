"""The sockets between a client and a server: packets out, packets in, questions with an answer."""

from __future__ import annotations

import math
import selectors
import socket
import struct
from dataclasses import dataclass

from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.packet import MAX_DATAGRAM_BYTES, Message, join, split
from agvbench.bus.clock import WallClock
from agvbench.errors import AdapterGoneError, LinkError, MessageError

COMMAND_PORT, DATA_PORT = 1510, 1511
_RECEIVE_BUFFER_BYTES = 4 << 20
_MOST_AT_ONCE = 256
POLL_S = 0.02
_ATTEMPTS = 6
_RELEARN_S = 2.0
_FRAME = struct.pack("<H", Message.FRAMEOFDATA)


def _is_frame(datagram: bytes) -> bool:
    return datagram[: len(_FRAME)] == _FRAME


@dataclass(frozen=True)
class Connection:
    """Where a server is, and how to talk to it.

    ``local`` is the address of this machine's network interface ("" for the one that leads there), ``version`` the bit
    stream to ask for (4.0 and later, unicast), None for the server's own. ``group`` and ``data_port`` are where a
    multicast server sends to if it does not say so itself, as those before 3.0.
    """

    server: str
    port: int = COMMAND_PORT
    local: str = ""
    version: Version | None = None
    group: str | None = None
    data_port: int | None = None
    answer_limit_s: float = 3.0

    def __str__(self) -> str:
        return f"natnet:{self.server}:{self.port}"


@dataclass
class Counters:
    """What happened on the way."""

    frames: int = 0
    lost: int = 0
    """Frames whose numbers were passed over."""
    repeated: int = 0
    """Frames with a number that was there already, or an older one."""
    malformed: int = 0
    first_malformed: str = ""
    foreign: int = 0
    """Datagrams of others than the server, of other sockets on its machine, too."""
    foreign_port: int | None = None
    """The port of the server's machine that such frames came from last."""

    def note(self, error: MessageError) -> None:
        """Count what could not be decoded."""
        self.malformed += 1
        self.first_malformed = self.first_malformed or str(error)


class Channel:
    """Sockets that hear the server only; ``packets_sent`` counts the packets that were sent to it.

    The server sends from its command port and from its data port; in unicast nothing else is taken. No document says
    which port a multicast server's frames come from: once none have come from those two for a while, frames from one
    other port of its machine are taken, until some come from those two.

    Attributes
    ----------
    ports
        Those two, as far as they are known.

    Raises
    ------
    LinkError
        If an address cannot be used.
    """

    def __init__(self, connection: Connection, counters: Counters) -> None:
        # Networks are waited for in real time, even where everything else is simulated.
        self._connection, self._clock, self._counters = connection, WallClock(), counters
        self._selector = selectors.DefaultSelector()
        self.packets_sent = 0
        self.ports = {connection.port, connection.data_port or DATA_PORT}
        self._joined = False
        self._frames_port: int | None = None
        self._frames_s = -math.inf
        try:
            self._server = (socket.gethostbyname(connection.server), connection.port)
            self._local = connection.local or self._route()
            self._command = self._open((self._local, 0))
        # A name with an empty part, or one that is too long, never gets as far as the network.
        except (OSError, UnicodeError) as error:
            raise self._unusable(error) from None

    def _unusable(self, error: OSError | UnicodeError) -> LinkError:
        self.close()
        why = getattr(error, "strerror", None) or getattr(error, "reason", None) or error
        return LinkError("address cannot be used", where=self._connection, value=why)

    def _route(self) -> str:
        """Return the address of the interface that leads to the server."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(self._server)
            return str(probe.getsockname()[0])

    def _open(self, address: tuple[str, int], *, shared: bool = False) -> socket.socket:
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._selector.register(opened, selectors.EVENT_READ)
        # A burst of frames with many bodies must fit, or the kernel drops them and says nothing.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        if shared:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.setblocking(False)
        opened.bind(address)
        return opened

    def join(self, group: str, port: int) -> None:
        """Hear a multicast group, too."""
        try:
            data = self._open((group, port), shared=True)
            member = socket.inet_aton(group) + socket.inet_aton(self._local)
            data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        except (OSError, UnicodeError) as error:
            raise self._unusable(error) from None
        self._joined, self._frames_s = True, self._clock.now()

    def send(self, message: Message, payload: bytes = b"") -> None:
        """Send a packet; while the network is away, what is missing shows in what does not arrive."""
        try:
            self._command.sendto(join(message, payload), self._server)
        except OSError:
            return
        self.packets_sent += 1

    def ask(self, message: Message, payload: bytes, wanted: Message) -> bytes:
        """Return the payload of the answer; what else arrives meanwhile is left out.

        Raises
        ------
        AdapterGoneError
            If there is none in time.
        """
        limit_s = self._connection.answer_limit_s
        deadline_s, again_s = self._clock.now() + limit_s, -math.inf
        while (now_s := self._clock.now()) < deadline_s:
            if now_s >= again_s:
                self.send(message, payload)
                again_s = now_s + limit_s / _ATTEMPTS
            for number, answer in self.arrived():
                if number == wanted:
                    return answer
        raise AdapterGoneError(
            "no NatNet server answers", where=self._connection, value=f"waited {limit_s:g} s",
            remedy="see whether Motive runs, streams (Edit > Settings > Streaming), and the network lets UDP through",
        )  # fmt: skip

    def arrived(self, limit_s: float = POLL_S) -> list[tuple[int, bytes]]:
        """Return what the server sent; wait for the first up to `limit_s` [s]."""
        packets = []
        for key, _ in self._selector.select(limit_s):
            opened: socket.socket = key.fileobj  # type: ignore[assignment]
            for _ in range(_MOST_AT_ONCE):
                try:
                    datagram, sender = opened.recvfrom(MAX_DATAGRAM_BYTES)
                except (BlockingIOError, ConnectionError):
                    break
                if not self._is_of_server(datagram, *sender):
                    self._note_foreign(datagram, *sender)
                    continue
                try:
                    packets.append(split(datagram))
                except MessageError as error:
                    self._counters.note(error)
        return packets

    def _note_foreign(self, datagram: bytes, host: str, port: int) -> None:
        self._counters.foreign += 1
        if host == self._server[0] and _is_frame(datagram):
            self._counters.foreign_port = port

    def _is_of_server(self, datagram: bytes, host: str, port: int) -> bool:
        known, is_frame = port in self.ports, _is_frame(datagram)
        if host != self._server[0] or not (known or (is_frame and self._joined)):
            return False
        now_s = self._clock.now()
        if not known and port != self._frames_port and now_s - self._frames_s <= _RELEARN_S:
            return False
        if is_frame:
            self._frames_port, self._frames_s = port, math.inf if known else now_s
        return True

    def close(self) -> None:
        """Hear nothing any more."""
        for key in list((self._selector.get_map() or {}).values()):
            key.fileobj.close()  # type: ignore[union-attr]
        self._selector.close()
