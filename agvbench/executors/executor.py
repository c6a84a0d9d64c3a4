"""What runs tasks: the interface, its options, and the bound on tasks in flight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Self, TypeVar

from agvbench.errors import FlagError
from agvbench.executors.task import Key, Outcome, Result, Task

RETRIES = 3
"""How many times a task is run again after a worker died under it; the default of Dask's scheduler, too."""
FLAG = "--cluster"
Item = TypeVar("Item")


@dataclass(frozen=True)
class ExecutorOptions:
    """Where tasks run.

    Parameters
    ----------
    address
        ``tcp://HOST:PORT`` or ``tls://HOST:PORT`` of a scheduler; "" for processes of this machine.
    jobs
        Tasks at a time on this machine; None for one per processor. A cluster runs one on each worker.
    insecure
        Connect without encryption to a scheduler on another machine.
    tls_ca_file, tls_cert, tls_key
        Certificate of the authority, and certificate and key of this client, for ``tls://``.

    Raises
    ------
    FlagError
        If `jobs` is below one.
    """

    address: str = ""
    jobs: int | None = None
    insecure: bool = False
    tls_ca_file: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise FlagError("is too small", where="--jobs", value=self.jobs, limit="at least 1")


class Executor(ABC):
    """Runs tasks; a subclass in a module of `agvbench.executors.kinds` is found by its schemes.

    As a context manager it releases its processes or its connection, and cancels what is in flight.
    """

    schemes: ClassVar[tuple[str, ...]]
    """Which addresses it takes: what precedes ``://``."""

    @classmethod
    @abstractmethod
    def check(cls, options: ExecutorOptions) -> None:
        """Raise `FlagError` or `FileError` if the options cannot be used; nothing is opened."""

    @classmethod
    @abstractmethod
    def open(cls, options: ExecutorOptions) -> Self:
        """Return an executor that is ready.

        Raises
        ------
        AgvbenchError
            If it cannot be reached, or its workers differ from this client.
        """

    @abstractmethod
    def run(self, tasks: Iterable[Task[Key]], kind: type[Result]) -> Iterator[Outcome[Key, Result]]:
        """Yield the outcome of each task as it ends; results are validated as `kind`.

        A bounded number of tasks is in flight, so that `tasks` may be endless and an interruption loses these only. A
        failure is an outcome, and ends nothing else. A task whose worker dies is run again, at most `RETRIES` times.
        """

    @abstractmethod
    def close(self) -> None:
        """End what is in flight, and release everything."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def in_flight(items: Iterator[Item], held: int, most: int) -> Iterator[Item]:
    """Yield as many further items as may be in flight beside those `held`, `most` altogether.

    >>> coming = iter("abcd")
    >>> list(in_flight(coming, 1, 3)), list(in_flight(coming, 3, 3)), list(in_flight(coming, 0, 3))
    (['a', 'b'], [], ['c', 'd'])
    """
    return islice(items, max(0, most - held))
