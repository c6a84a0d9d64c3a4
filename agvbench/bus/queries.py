"""Queries to adapters: one query, one answer, or an error that says what came instead."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from agvbench.bus.messages.codec import ENCODING, encode
from agvbench.bus.messages.event import Event, decode_event
from agvbench.errors import AdapterGoneError, AgvbenchError, LinkError

_ANSWERS_READ = 16
_CHECK_PERIOD_S = 0.1
_NOTICED_S = 0.5
"""How long [s] after the end of a query the notice that its adapter vanished may arrive."""


def ask(session: Any, key: str, payload: bytes, limit_s: float, check: Callable[[], None] = lambda: None) -> bytes:
    """Return what the queryable at `key` answers to `payload`.

    ``check`` is called again and again meanwhile; what it raises ends the wait.

    Raises
    ------
    AdapterGoneError
        If nothing answers within `limit_s` [s].
    AgvbenchError
        What the adapter answered instead, of the class that it was there.
    """
    began_s = time.monotonic()
    for reply in islice(_replies(session, key, payload, limit_s, check), _ANSWERS_READ):
        if reply.ok is not None:
            return bytes(reply.ok.payload.to_bytes())
        if reply.err.encoding == ENCODING:  # else Zenoh itself says that there was no answer in time
            raise decode_event(bytes(reply.err.payload.to_bytes())).as_error()
    waited_s = time.monotonic() - began_s
    _check_until(check, min(_NOTICED_S, limit_s - waited_s))
    raise AdapterGoneError(
        "no answer", where=key, value=f"waited {min(waited_s, limit_s):.2g} s",
        remedy="see whether the adapter's process still runs",
    )  # fmt: skip


def _replies(session: Any, key: str, payload: bytes, limit_s: float, check: Callable[[], None]) -> Iterator[Any]:
    """Yield the replies to a query until it ends; call `check` while there are none."""
    import zenoh

    replies: queue.SimpleQueue[Any] = queue.SimpleQueue()
    handler = zenoh.handlers.Callback(replies.put, lambda: replies.put(None))
    block = zenoh.CongestionControl.BLOCK
    try:
        session.get(key, handler, payload=payload, encoding=ENCODING, timeout=limit_s, congestion_control=block)
    except zenoh.ZError as error:
        raise LinkError("the bus cannot be used", where=key, value=str(error).split(" at /")[0]) from None
    while True:
        try:
            reply = replies.get(timeout=_CHECK_PERIOD_S)
        except queue.Empty:
            check()
            continue
        if reply is None:
            return
        yield reply


def _check_until(check: Callable[[], None], limit_s: float) -> None:
    """Call `check` for `limit_s` [s]."""
    end_s = time.monotonic() + limit_s
    check()
    while time.monotonic() < end_s:
        time.sleep(0.01)
        check()


def refusal(role: str, error: AgvbenchError) -> bytes:
    """Return the bytes of an error reply that `ask` turns into `error` again."""
    return encode(Event.of_error(error, role))
