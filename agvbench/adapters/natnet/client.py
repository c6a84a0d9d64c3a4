"""A client: connects, keeps itself known, follows names and clock, and hands on frames with their capture time.

One thread does everything, so that nothing needs a lock: it waits for packets, and between them sends what is due.
"""

from __future__ import annotations

import math
import struct
import threading
from collections.abc import Callable
from typing import NamedTuple

from agvbench.adapters.natnet.channel import DATA_PORT, POLL_S, Channel, Connection, Counters
from agvbench.adapters.natnet.clock_sync import ClockSync, Stamp
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.description import decode_descriptions
from agvbench.adapters.natnet.protocol.frame import MODELS_CHANGED, FrameOfData, decode_frame
from agvbench.adapters.natnet.protocol.packet import Message
from agvbench.adapters.natnet.protocol.server_info import ServerInfo, decode_server_info
from agvbench.bus.clock import Clock
from agvbench.errors import AdapterGoneError, LinkError, MessageError

KEEP_ALIVE_S, ECHO_S, FAST_ECHO_S, MODELS_S = 4.0, 1.0, 0.05, 0.5
MAX_RATE_HZ = 10_000.0
"""No camera is as fast; a higher rate from a server is rejected."""
_FAST_ECHOES = 8
_RESTART_FRAMES = 1000  # a number lower by more than this is that of a server that began anew, not a late frame
_NEVER_S = math.inf
_TICKS, _ECHO, _FLOAT = struct.Struct("<Q"), struct.Struct("<QQ"), struct.Struct("<f")


class Seen(NamedTuple):
    """A frame, when its exposure was in host time, and when it arrived [s]."""

    frame: FrameOfData
    captured: Stamp
    received_s: float


class Client:
    """A connection to a NatNet server, until `close`.

    Parameters
    ----------
    connection
        Where the server is.
    clock
        The host's.
    seen
        Gets every frame in order, once, in the client's thread.
    idle
        Called in that thread with the time [s] whenever what had arrived was taken, frames or not.

    Attributes
    ----------
    info
        Of the server that answered.
    version
        Of the bit stream that arrives.
    rate_hz
        The camera's frame rate [Hz]; NaN if the server does not say.
    names
        Ids of rigid bodies by name.
    counters
        What was lost, repeated, malformed or foreign.

    Raises
    ------
    AdapterGoneError
        If no server answers.
    LinkError
        If an address cannot be used, or the server does not stream in the version asked for.
    """

    def __init__(
        self,
        connection: Connection,
        clock: Clock,
        seen: Callable[[Seen], None],
        idle: Callable[[float], None] = lambda _: None,
    ) -> None:
        self._connection, self._clock, self._seen, self._idle = connection, clock, seen, idle
        self.counters, self.sync = Counters(), ClockSync()
        self.names: dict[str, int] = {}
        self._bodies, self._echoes = -1, 0
        self._number: int | None = None
        self._keep_alive_s = self._echo_s = self._models_s = -math.inf
        self._closed, self._ready = threading.Event(), threading.Event()
        self._channel = Channel(connection, self.counters)
        try:
            self.info = self._connect()
            self._channel.ports.add(self.info.data_port or DATA_PORT)
            self.version = self._agree()
            self.rate_hz = self._frame_rate()
            if (group := connection.group or self.info.multicast) is not None:
                self._channel.join(group, connection.data_port or self.info.data_port or DATA_PORT)
        except BaseException:
            self._channel.close()
            raise
        self._thread = threading.Thread(target=self._run, name="natnet", daemon=True)

    def _connect(self) -> ServerInfo:
        info = decode_server_info(self._channel.ask(Message.CONNECT, b"Ping\0", Message.SERVERINFO))
        info.version.checked()
        return info

    def _agree(self) -> Version:
        wanted, version = self._connection.version, self.info.version
        if wanted is None or wanted == version:
            return version
        if version < (4, 0) or self.info.multicast is not None:
            raise LinkError(
                "NatNet server streams in its own version only", where=self._connection, value=version,
                limit=f"{wanted} was asked for", remedy="leave the version out",
            )  # fmt: skip
        self._channel.ask(Message.REQUEST, f"Bitstream,{wanted}\0".encode(), Message.RESPONSE)
        return wanted

    def _frame_rate(self) -> float:
        try:
            answer = self._channel.ask(Message.REQUEST, b"FrameRate\0", Message.RESPONSE)
        except AdapterGoneError:
            return math.nan
        rate_hz = float(_FLOAT.unpack(answer)[0]) if len(answer) == _FLOAT.size else math.nan
        return rate_hz if 0.0 < rate_hz <= MAX_RATE_HZ else math.nan

    def start(self) -> None:
        """Hand on frames from now on, in a thread; return when names and clock are known, or after a while."""
        self._thread.start()
        self._ready.wait(self._connection.answer_limit_s)

    def _run(self) -> None:
        while not self._closed.is_set():
            self.step()
            if self.ready:
                self._ready.set()

    @property
    def packets_sent(self) -> int:
        """How many packets the server was sent."""
        return self._channel.packets_sent

    @property
    def ready(self) -> bool:
        """Whether names and clock are known."""
        return bool(self.names) and (self.info.clock_hz is None or self.sync.ready)

    def step(self, limit_s: float = POLL_S) -> None:
        """Send what is due, take what arrives within `limit_s` [s]: what the thread does all the time."""
        self._send_what_is_due()
        for message, payload in self._channel.arrived(limit_s):
            try:
                self._take(message, payload)
            except MessageError as error:
                self.counters.note(error)
        self._idle(self._clock.now())

    def _send_what_is_due(self) -> None:
        now_s = self._clock.now()
        if now_s >= self._keep_alive_s:
            self._channel.send(Message.KEEPALIVE)
            self._keep_alive_s = now_s + KEEP_ALIVE_S
        if now_s >= self._echo_s and self.info.clock_hz is not None:
            self._channel.send(Message.ECHO_REQUEST, _TICKS.pack(max(0, int(now_s * 1e9))))
            self._echo_s = now_s + (FAST_ECHO_S if self._echoes < _FAST_ECHOES else ECHO_S)
        if now_s >= self._models_s:
            self._channel.send(Message.REQUEST_MODELDEF)
            self._models_s = now_s + MODELS_S

    def _take(self, message: int, payload: bytes) -> None:
        now_s = self._clock.now()
        if message == Message.FRAMEOFDATA:
            self._take_frame(decode_frame(payload, self.version), now_s)
        elif message == Message.MODELDEF:
            self.names = {body.name: body.id for body in decode_descriptions(payload, self.version)}
            self._models_s = _NEVER_S
        elif message == Message.ECHO_RESPONSE and len(payload) == _ECHO.size and self.info.clock_hz is not None:
            sent, ticks = _ECHO.unpack(payload)
            self._echoes += 1
            self.sync.echoed(min(sent / 1e9, now_s), now_s, ticks / self.info.clock_hz)

    def _take_frame(self, frame: FrameOfData, received_s: float) -> None:
        step = 1 if self._number is None else frame.number - self._number
        if -_RESTART_FRAMES < step <= 0:
            self.counters.repeated += 1
            return
        self.counters.lost += max(0, step - 1)
        self.counters.frames += 1
        self._number = frame.number
        if frame.flags & MODELS_CHANGED or len(frame.bodies) != self._bodies:
            self._bodies, self._models_s = len(frame.bodies), -math.inf
        stamp = self._stamp(frame, received_s)
        if stamp is not None:
            self._seen(Seen(frame, stamp, received_s))

    def _stamp(self, frame: FrameOfData, received_s: float) -> Stamp | None:
        """Return when the exposure was in host time; None before the first echo.

        Before version 3.0 nothing says: it is the arrival, and its uncertainty is not known.
        """
        if self.info.clock_hz is None or frame.exposed_ticks < 0:
            return Stamp(received_s, math.inf)
        if not self.sync.ready:
            return None
        return self.sync.host_time(frame.exposed_ticks / self.info.clock_hz)

    def close(self) -> None:
        """Disconnect from the server, and receive no more."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._channel.send(Message.DISCONNECT)
        self._channel.close()
