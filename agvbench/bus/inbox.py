"""What arrives for a runner: frames and events of one vehicle, in order, by `recv()`.

`recv()` beats callbacks by a thread switch, but has no time limit: a thread that must end a wait calls `Inbox.wake`.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from agvbench.bus.counters import LossCounter, RateLimitedCounter
from agvbench.bus.keys import AGV, MOCAP, Keys
from agvbench.bus.messages.codec import decoder
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.frames import FramesMessage
from agvbench.errors import LinkError, MessageError

_CAPACITY = 1024
_EVENTS_KEPT = 1000
_decode: Callable[[bytes], FramesMessage | Event] = decoder(FramesMessage, Event)


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
        """Wait for the next report; None after a call of `wake`.

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
        if not payload:
            return None  # a call to wake up
        try:
            message = _decode(payload)
        except MessageError as why:
            where, value, limit, remedy = self._keys.report, why.value, why.limit, why.remedy
            raise MessageError(why.what, where=where, value=value, limit=limit, remedy=remedy) from None
        if isinstance(message, Event):
            if message.role in self.event_losses:
                self.event_losses[message.role].saw(message.source, message.sequence)
            self.events.append(message)
            return message
        loss = self.frames_loss
        if message.sequence == loss.expected and message.source == loss.source:
            loss.expected += 1
        else:
            loss.saw(message.source, message.sequence)
        return message

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
