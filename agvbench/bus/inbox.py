"""What arrives for a runner: frames and events of one vehicle, in order, by `recv()`.

`recv()` beats callbacks by a thread switch, but has no time limit: whoever must end a wait calls `Inbox.wake`.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from agvbench.bus.counters import LossCounter, RateLimitedCounter
from agvbench.bus.keys import AGV, MOCAP, Keys
from agvbench.bus.messages.event import Event, Level, decode_event
from agvbench.bus.messages.frames import FramesMessage, decode_frames
from agvbench.bus.messages.wire import HEADER_BYTES, Kind
from agvbench.errors import LinkError, MessageError

_CAPACITY = 1024
_EVENTS_KEPT = 1000
_KIND_AT = 5
_EVENT = Kind.EVENT.value


class Inbox:
    """Receives the reports of one vehicle, decoded; counts what is missing.

    Attributes
    ----------
    frames_loss
        What was lost of the frames messages.
    events
        The last thousand events, oldest first, until they are taken.
    malformed
        How many messages could not be decoded.
    """

    def __init__(self, session: Any, keys: Keys) -> None:
        import zenoh

        self.frames_loss = LossCounter()
        self.event_losses = {role: LossCounter() for role in (AGV, MOCAP)}
        self.malformed = RateLimitedCounter()
        self.events: deque[Event] = deque(maxlen=_EVENTS_KEPT)
        self._keys = keys
        self._subscriber = session.declare_subscriber(keys.report, zenoh.handlers.FifoChannel(_CAPACITY))
        # The subscriber itself is locked while a thread waits in it; its handler is not.
        self._recv = self._subscriber.handler.recv
        self._closed_error = zenoh.ZError
        self._wake_lock = threading.Lock()
        self._waker: Any = session.declare_publisher(
            keys.report,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=zenoh.Locality.SESSION_LOCAL,
        )

    def wake(self) -> None:
        """Make `receive` return None once; safe in any thread."""
        with self._wake_lock:
            if self._waker is not None:
                self._waker.put(b"")

    def receive(self) -> FramesMessage | Event | None:
        """Wait for the next report; None if somebody called `wake`.

        Raises
        ------
        MessageError
            If it cannot be decoded.
        LinkError
            If the session was closed.
        """
        try:
            payload: bytes = self._recv().payload.to_bytes()
        except self._closed_error:
            raise LinkError("the bus was closed", where=self._keys.root) from None
        try:
            message = decode_frames(payload)
        except MessageError as error:
            return self._read_other(payload, error)
        loss = self.frames_loss
        sequence, _, _, _, _, _, source = message
        if sequence == loss.expected and source == loss.source:
            loss.expected += 1
        else:
            loss.saw(source, sequence)
        return message

    def _read_other(self, payload: bytes, error: MessageError) -> Event | None:
        """Return what is no frames: nothing, which is a call to wake up, or an event; else raise what is wrong."""
        if not payload:
            return None
        try:
            if len(payload) < HEADER_BYTES or payload[_KIND_AT] != _EVENT:
                raise error
            event = decode_event(payload)
        except MessageError as why:
            raise MessageError(
                why.what, where=self._keys.report, value=why.value, limit=why.limit, remedy=why.remedy
            ) from None
        if event.role in self.event_losses:
            self.event_losses[event.role].saw(event.source, event.sequence)
        self.events.append(event)
        return event

    def note_malformed(self, error: MessageError) -> None:
        """Count a message that could not be decoded; keep an event of some."""
        if self.malformed.add():
            self.events.append(Event(0, "runner", Level.WARNING, "MessageError", f"{error} ({self.malformed})"))

    def take_events(self) -> list[Event]:
        """Return the events, oldest first, and forget them; safe beside a thread that adds some."""
        return [self.events.popleft() for _ in range(len(self.events))]

    def close(self) -> None:
        """Receive no more; a thread that waits in `receive` gets its `LinkError`."""
        self._subscriber.undeclare()
        with self._wake_lock:
            self._waker.undeclare()
            self._waker = None
