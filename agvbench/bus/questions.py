"""Questions to adapters: one query, one answer, or an error that says what came instead."""

from __future__ import annotations

from itertools import islice
from typing import Any

from agvbench.bus.event_message import Event, decode_event, encode_event
from agvbench.errors import AdapterGoneError, AgvbenchError, LinkError

_ANSWERS_READ = 16


def ask(session: Any, key: str, payload: bytes, limit_s: float) -> bytes:
    """Return what the queryable at `key` answers to `payload`.

    Raises
    ------
    AdapterGoneError
        If nothing answers within `limit_s` [s].
    AgvbenchError
        What the adapter answered instead, of the class that it was there.
    """
    import zenoh

    try:
        replies = session.get(key, payload=payload, timeout=limit_s, congestion_control=zenoh.CongestionControl.BLOCK)
    except zenoh.ZError as error:
        raise LinkError("the bus cannot be used", where=key, value=str(error).split(" at /")[0]) from None
    for reply in islice(replies, _ANSWERS_READ):
        if reply.ok is not None:
            return bytes(reply.ok.payload.to_bytes())
        refusal = bytes(reply.err.payload.to_bytes())
        if refusal.startswith(b"AGVB"):
            raise decode_event(refusal).as_error()
    raise AdapterGoneError(
        "no answer", where=key, value=f"waited {limit_s:g} s", remedy="see whether the adapter's process still runs"
    )


def refusal(role: str, error: AgvbenchError) -> bytes:
    """Return the bytes of an error reply that `ask` turns into `error` again."""
    return encode_event(Event.of_error(error, role))
