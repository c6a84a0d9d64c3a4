"""The event message: what an adapter has to say besides frames.

Body after the header: acknowledged (u64), t_s (f64), level (u8), then the texts role, kind and text.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from agvbench import errors
from agvbench.bus.wire import MAX_TEXT_BYTES, Kind, Reader, pack_header, pack_text, unpack_header

_BODY = struct.Struct("<QdB")

RUNNER_SILENT = "runner_silent"
"""The kind of the event by which a vehicle says that it stopped itself, having heard nothing."""


class Level(IntEnum):
    """How grave an event is."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Event:
    """What an adapter had to say.

    ``acknowledged`` is the command that it answers (0: none), ``t_s`` [s] the adapter's clock, ``role`` says
    which adapter, ``kind`` is a word for programs (for errors: the name of the error's class).
    """

    sequence: int
    role: str
    level: Level
    kind: str
    text: str
    acknowledged: int = 0
    t_s: float = 0.0
    source: int = 0

    def as_error(self) -> errors.AgvbenchError:
        """Return the error that this event tells of, of its own class where there is one."""
        kind = getattr(errors, self.kind, None)
        known = isinstance(kind, type) and issubclass(kind, errors.AgvbenchError)
        return (kind if known and kind else errors.LinkError)(self.text, where=f"{self.role} adapter")


def encode_event(event: Event) -> bytes:
    """Return the event's bytes; a text that is too long is cut."""
    header = pack_header(Kind.EVENT, source=event.source, count=1, sequence=event.sequence)
    body = _BODY.pack(event.acknowledged, event.t_s, event.level)
    text = event.text.encode("utf-8", "replace")[:MAX_TEXT_BYTES].decode("utf-8", "ignore")
    return header + body + pack_text(event.role) + pack_text(event.kind) + pack_text(text)


def decode_event(payload: bytes) -> Event:
    """Return the event that `payload` holds.

    Raises
    ------
    MessageError
        If it is not an event message that this version writes.
    """
    header = unpack_header(payload, Kind.EVENT)
    reader = Reader(payload)
    acknowledged, t_s, level = reader.fields(_BODY)
    role, kind, text = reader.text(), reader.text(), reader.text()
    reader.finish()
    if level not in tuple(Level):
        raise errors.MessageError("event of an unknown level", value=level, limit="0 to 2")
    return Event(header.sequence, role, Level(level), kind, text, acknowledged, t_s, header.source)
