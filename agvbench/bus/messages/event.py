"""The event message: what an adapter has to say besides frames; an error arrives as it was raised."""

from __future__ import annotations

from enum import IntEnum
from typing import Self

from agvbench import errors
from agvbench.bus.messages.codec import MAX_TEXT, Message, Number, Source, Text, decoder
from agvbench.bus.messages.texts import cut
from agvbench.registry import own_classes

_ERRORS = {cls.__name__: cls for cls in own_classes(errors, errors.AgvbenchError)}
_DETAILS = ("where", "value", "limit", "remedy")

COMMANDS_LATE, COMMANDS_LOST, RUNNER_SILENT = "commands_late", "commands_lost", "runner_silent"
VEHICLE_STOPPED_ITSELF = "vehicle_stopped_itself"
NOT_AS_PLANNED = (COMMANDS_LATE, VEHICLE_STOPPED_ITSELF, RUNNER_SILENT, COMMANDS_LOST)
"""Kinds of events after which a run was not driven as it was planned, those that say most first."""


class Level(IntEnum):
    """How severe an event is."""

    INFO = 0
    WARNING = 1
    ERROR = 2


class Event(Message, tag="event", frozen=True):
    """What an adapter had to say.

    ``acknowledged`` is the command that it answers (0: none), ``t_s`` [s] the adapter's clock, ``role`` says
    which adapter, ``kind`` is a word for programs (for errors: the name of the error's class). ``text`` is a line for
    people; of an error it is what is wrong, and the fields after ``source`` are those of `AgvbenchError`. These
    texts are cut where they are too long, and what is no character in them is replaced.
    """

    sequence: Number
    role: Text
    level: Level
    kind: Text
    text: Text
    acknowledged: Number = 0
    t_s: float = 0.0
    source: Source = 0
    where: Text | None = None
    value: Text | None = None
    limit: Text | None = None
    remedy: Text | None = None

    def __post_init__(self) -> None:
        cut(self, ("text", *_DETAILS), MAX_TEXT)

    @classmethod
    def of_error(
        cls, error: errors.AgvbenchError, role: str, *, sequence: int = 0, acknowledged: int = 0, t_s: float = 0.0,
        source: int = 0,
    ) -> Self:  # fmt: skip
        """Return the event that reports `error`, with all its fields."""
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
        """Return the error that this event reports, of its own class where there is one."""
        kind = _ERRORS.get(self.kind, errors.LinkError)
        where = f"{self.role} adapter" if self.where is None else f"{self.role} adapter: {self.where}"
        return kind(self.text, where=where, value=self.value, limit=self.limit, remedy=self.remedy)


decode_event = decoder(Event)
