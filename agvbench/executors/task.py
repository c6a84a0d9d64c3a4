"""A task, its outcome, and how it runs on a worker: what travels back is bytes that the client validates by type."""

from __future__ import annotations

import platform
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from agvbench import __version__
from agvbench.errors import AgvbenchError, LinkError

Key = TypeVar("Key")
Result = TypeVar("Result")
VERSIONS = (f"agvbench {__version__}", f"Python {platform.python_version()}")


@dataclass(frozen=True)
class Task(Generic[Key]):
    """A call of a function of a module, ``function(*arguments)``, known to its client as `key`."""

    key: Key
    function: Callable[..., object]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Done(Generic[Key, Result]):
    """What a task returned."""

    key: Key
    result: Result


@dataclass(frozen=True)
class Failed(Generic[Key]):
    """Why a task returned nothing, in one line.

    ``was_raised`` says that its function raised an error of its own, and not that a worker died.
    """

    key: Key
    cause: str
    was_raised: bool = False


Outcome = Done[Key, Result] | Failed[Key]


class _Answer(msgspec.Struct):
    """What a worker returns: a result in MessagePack, or the cause of a failure."""

    result: msgspec.Raw = msgspec.Raw(b"\xc0")
    cause: str = ""
    is_internal: bool = False


def run_task(function: Callable[..., object], arguments: tuple[Any, ...], versions: tuple[str, ...]) -> bytes:
    """Run a task on a worker; return its result or the cause of its failure, encoded.

    `versions` are those of the client: a worker with others runs nothing.
    """
    if versions != VERSIONS:
        return msgspec.msgpack.encode(_Answer(cause=f"worker has {_named(VERSIONS)}, the client {_named(versions)}"))
    try:
        result = msgspec.Raw(msgspec.msgpack.encode(function(*arguments), enc_hook=_plain))
    except AgvbenchError as error:
        return msgspec.msgpack.encode(_Answer(cause=cause_of(error)))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - one task must not end the others
        return failure(error)
    return msgspec.msgpack.encode(_Answer(result=result))


def failure(error: BaseException) -> bytes:
    """Return the answer of a task that raised an error which is not the user's."""
    return msgspec.msgpack.encode(_Answer(cause=cause_of(error), is_internal=True))


def outcome_of(key: Key, answer: object, kind: type[Result]) -> Outcome[Key, Result]:
    """Return the outcome that the bytes of a worker encode; `kind` is the type that the result must have."""
    if not isinstance(answer, bytes):
        return Failed(key, f"worker returned {type(answer).__name__} instead of bytes")
    try:
        decoded = msgspec.msgpack.decode(answer, type=_Answer)
        if decoded.cause:
            return Failed(key, in_one_line(decoded.cause), was_raised=decoded.is_internal)
        return Done(key, msgspec.msgpack.decode(decoded.result, type=kind))
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        return Failed(key, f"worker returned what is no {kind.__name__}: {in_one_line(error)}")


def require_same_versions(workers: dict[str, Any], address: str) -> None:
    """Raise `LinkError` unless each of the `workers`, by name, has the versions of this client."""
    for name, versions in workers.items():
        if tuple(versions) != VERSIONS:
            raise LinkError(
                "worker has other versions than the client", where=f"{address}: {name}", value=_named(versions),
                limit=_named(VERSIONS), remedy="install the same agvbench and Python there",
            )  # fmt: skip


def versions() -> tuple[str, ...]:
    """Return the versions that decide what a task computes, of the process that runs this."""
    return VERSIONS


def _plain(value: Any) -> Any:
    """Return a number of numpy as one of Python."""
    if hasattr(value, "item"):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} cannot be returned by a task")


def _named(names: Any) -> str:
    return " and ".join(map(str, names))


def cause_of(error: BaseException) -> str:
    """Return in one line what an error says; of an internal error also its type, and where it was raised."""
    said = in_one_line(error)
    if isinstance(error, AgvbenchError):
        return said or type(error).__name__
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {said} ({Path(last.filename).name}, line {last.lineno}, in {last.name})"


def in_one_line(said: object) -> str:
    """Return a text without line breaks."""
    return " ".join(str(said).split())
