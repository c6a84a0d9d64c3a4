"""What a runner sends: numbered commands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from agvbench.bus.counters import Sequence
from agvbench.bus.keys import Keys
from agvbench.bus.messages.codec import ENCODING, encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.errors import LinkError
from agvbench.types import Command


class CommandOutbox:
    """Publishes commands to one vehicle: never dropped, never batched with others."""

    def __init__(self, session: Any, keys: Keys) -> None:
        import zenoh

        sequence = Sequence()
        self._take = sequence.take
        self.source = sequence.source
        """What distinguishes this sender from others."""
        self.last = 0
        """The sequence number of the last command (0: none)."""
        self._keys = keys
        self._error = zenoh.ZError
        self._publisher = session.declare_publisher(
            keys.command,
            encoding=ENCODING,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._put: Callable[[bytes], None] = self._publisher.put

    def send(self, command: Command, t_s: float, hold_s: float, flags: int = CommandFlags.NONE) -> int:
        """Publish a command; return its sequence number.

        Raises
        ------
        MessageError
            If a number is not finite, or the hold is out of range.
        LinkError
            If the session or this outbox was closed.
        """
        self.last = sequence = self._take()
        try:
            self._put(encode(CommandMessage(sequence, t_s, command, hold_s, flags, self.source)))
        except self._error:
            raise LinkError("the bus was closed", where=self._keys.root) from None
        return sequence

    def close(self) -> None:
        """Publish no more; also while another thread is inside `send`, waiting for a receiver that takes nothing."""
        self._put = self._refuse
        # Zenoh locks a publisher ("Already borrowed") as long as a thread sends with it: it goes with the session then.
        with suppress(RuntimeError):
            self._publisher.undeclare()

    def _refuse(self, _: bytes) -> None:
        raise self._error
