"""The event message: what an adapter has to say besides frames.

Body after the header: acknowledged (u64), t_s (f64), level (u8), then the texts role, kind and text, and of the texts
where, value, limit and remedy those that the header's flags (1, 2, 4, 8) announce: an error arrives as it was raised.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

from agvbench import errors
from agvbench.bus.messages.wire import MAX_TEXT_BYTES, Kind, Reader, pack_header, pack_text, unpack_header
from agvbench.registry import own_classes

_BODY = struct.Struct("<QdB")
_ERRORS = {cls.__name__: cls for cls in own_classes(errors, errors.AgvbenchError)}
_DETAILS = ("where", "value", "limit", "remedy")
_ALL_DETAILS = (1 << len(_DETAILS)) - 1

COMMANDS_LATE, COMMANDS_LOST, RUNNER_SILENT = "commands_late", "commands_lost", "runner_silent"
VEHICLE_STOPPED_ITSELF = "vehicle_stopped_itself"
NOT_AS_PLANNED = (COMMANDS_LATE, VEHICLE_STOPPED_ITSELF, RUNNER_SILENT, COMMANDS_LOST)
"""Kinds of events after which a run was not driven as it was planned, those that say most first."""


class Level(IntEnum):
    """How grave an event is."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Event:
    """What an adapter had to say.

    ``acknowledged`` is the command that it answers (0: none), ``t_s`` [s] the adapter's clock, ``role`` says
    which adapter, ``kind`` is a word for programs (for errors: the name of the error's class). ``text`` is a line for
    people; of an error it is what is wrong, and the fields after ``source`` are those of `AgvbenchError`.
    """

    sequence: int
    role: str
    level: Level
    kind: str
    text: str
    acknowledged: int = 0
    t_s: float = 0.0
    source: int = 0
    where: str | None = None
    value: str | None = None
    limit: str | None = None
    remedy: str | None = None

    @classmethod
    def of_error(
        cls, error: errors.AgvbenchError, role: str, *, sequence: int = 0, acknowledged: int = 0, t_s: float = 0.0,
        source: int = 0,
    ) -> Self:  # fmt: skip
        """Return the event that tells of `error`, with all its fields."""
        said = (getattr(error, name) for name in _DETAILS)
        details = (None if one is None else str(one) for one in said)
        kind = type(error).__name__
        return cls(sequence, role, Level.ERROR, kind, error.what, acknowledged, t_s, source, *details)

    @property
    def line(self) -> str:
        """What people read of it."""
        what = errors.AgvbenchError(self.text, where=self.where, value=self.value, limit=self.limit, remedy=self.remedy)
        return str(what)

    def as_error(self) -> errors.AgvbenchError:
        """Return the error that this event tells of, of its own class where there is one."""
        kind = _ERRORS.get(self.kind, errors.LinkError)
        where = f"{self.role} adapter" if self.where is None else f"{self.role} adapter: {self.where}"
        return kind(self.text, where=where, value=self.value, limit=self.limit, remedy=self.remedy)


def encode_event(event: Event) -> bytes:
    """Return the event's bytes; a text that is too long is cut."""
    details = [getattr(event, name) for name in _DETAILS]
    flags = sum(1 << bit for bit, text in enumerate(details) if text is not None)
    header = pack_header(Kind.EVENT, flags, source=event.source, count=1, sequence=event.sequence)
    body = _BODY.pack(event.acknowledged, event.t_s, event.level)
    texts = [_cut(text) for text in (event.text, *details) if text is not None]
    return header + body + b"".join(map(pack_text, (event.role, event.kind, *texts)))


def _cut(text: str) -> str:
    return text.encode("utf-8", "replace")[:MAX_TEXT_BYTES].decode("utf-8", "ignore")


def decode_event(payload: bytes) -> Event:
    """Return the event that `payload` holds.

    Raises
    ------
    MessageError
        If it is not an event message that this version writes.
    """
    header = unpack_header(payload, Kind.EVENT, _ALL_DETAILS)
    reader = Reader(payload)
    acknowledged, t_s, level = reader.fields(_BODY)
    role, kind, text = reader.text(), reader.text(), reader.text()
    details = [reader.text() if header.flags >> bit & 1 else None for bit in range(len(_DETAILS))]
    reader.finish()
    if level not in tuple(Level):
        raise errors.MessageError("event of an unknown level", value=level, limit="0 to 2")
    return Event(header.sequence, role, Level(level), kind, text, acknowledged, t_s, header.source, *details)
