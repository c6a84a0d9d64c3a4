"""Fields of messages by dotted paths: ``twist.linear.x``, or ``data.0`` for the first number of an array."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from agvbench.errors import FileError

_PATH = re.compile(r"[A-Za-z]\w*(\.[A-Za-z]\w*|\.\d{1,6})*", re.ASCII)
_SHOWN = 20


class Field:
    """A field of the messages of a topic, by its dotted path; the empty path is the message itself.

    Raises
    ------
    FileError
        If the path is none, or a message has no such field; the line lists those that it has there.
    """

    def __init__(self, field: str, topic: str, path: Path) -> None:
        if field and not _PATH.fullmatch(field):
            what, remedy = f"topic {topic}: cannot be a field", "write it as twist.linear.x or data.0"
            raise FileError(what, where=path, value=repr(field)[:80], remedy=remedy)
        self._field, self._topic, self._path = field, topic, path
        self._parts = [int(part) if part.isdigit() else part for part in field.split(".")] if field else []

    def of(self, message: Any) -> Any:
        """Return the field of a message."""
        current = message
        for part in self._parts:
            try:
                current = getattr(current, part) if isinstance(part, str) else current[part]
            except (AttributeError, IndexError, TypeError):
                has = ", ".join(names_of(current)[:_SHOWN]) or "none"
                raise FileError(
                    f"topic {self._topic} has no field {self._field} (in place of {part} it has {has})",
                    where=self._path, remedy="correct the mapping",
                ) from None  # fmt: skip
        return current

    def number(self, message: Any) -> float:
        """Return the number in the field, true and false as 1 and 0; raise `FileError` if it contains no number."""
        value = self.of(message)
        if isinstance(value, str) or names_of(value) or hasattr(value, "__len__"):
            has = ", ".join(names_of(value)[:_SHOWN])
            remedy = f"give one of its fields: {has}" if has else "give the field of a number"
            raise FileError(f"topic {self._topic}: {self._field} is no number", where=self._path, remedy=remedy)
        return float(value)


def names_of(value: Any) -> list[str]:
    """Return the names of the fields of a message, or the indices of an array."""
    if hasattr(value, "__msgtype__"):
        return [name for name in vars(value) if not name.startswith("_")]
    return [] if isinstance(value, str) or not hasattr(value, "__len__") else [str(i) for i in range(len(value))]


def stamp_ns(message: Any) -> int | None:
    """Return the stamp of a message's header [ns since 1970]; None if its type has no header."""
    stamp: Any = getattr(getattr(message, "header", None), "stamp", None)
    if not hasattr(stamp, "sec"):
        return None
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def numbers_in(message: Any, before: str = "", depth: int = 4) -> Iterator[str]:
    """Yield the paths of all fields that are numbers; those of arrays are left out."""
    for name in names_of(message) if hasattr(message, "__msgtype__") else ():
        value, field = getattr(message, name), f"{before}{name}"
        if isinstance(value, int | float):
            yield field
        elif depth:
            yield from numbers_in(value, f"{field}.", depth - 1)


def vector(value: Any, names: str) -> tuple[float, ...]:
    """Return the fields of `value` with these names of one letter; raise `AttributeError` if it lacks one."""
    return tuple(float(getattr(value, name)) for name in names)
