"""What a target is, and how targets are found."""

from __future__ import annotations

import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar

from agvbench.errors import AgvbenchError
from agvbench.registry import classes_by_file

CORPUS = Path(__file__).parent / "corpus"
_LONGEST_LINE = 4000


class Target(ABC):
    """Something that takes bytes from outside.

    A subclass is one file in ``fuzz/targets/``; its decoders are imported in its ``__init__``, which is when a fuzzer
    instruments them.
    """

    name: ClassVar[str]
    """Of the target, and of its folder in the corpus."""
    instruments: ClassVar[tuple[str, ...]]
    """Packages and modules whose branches guide the fuzzer."""
    longest: ClassVar[int] = 2048
    """How many bytes [B] a fuzzer's input has at most."""

    @classmethod
    def missing(cls) -> str:
        """Say what this machine lacks for the target; "" if nothing."""
        return ""

    @abstractmethod
    def seeds(self) -> Iterable[bytes]:
        """Return inputs that are right, to begin with."""

    @abstractmethod
    def feed(self, data: bytes) -> None:
        """Decode `data`; raise an `AgvbenchError` if that cannot be, and nothing else."""

    def check(self, data: bytes) -> None:
        """Feed, and see that an error is one line that a person can read."""
        try:
            self.feed(data)
        except AgvbenchError as error:
            line = str(error)
            assert "\n" not in line, line
            assert len(line) < _LONGEST_LINE, line

    def corpus(self) -> list[Path]:
        """Return the inputs that are kept."""
        return sorted(path for path in (CORPUS / self.name).glob("*") if path.is_file())


class FileTarget(Target):
    """A target that reads a file."""

    suffix: ClassVar[str] = ""

    def __init__(self) -> None:
        # In memory where there is such a place: a disk would be what is measured.
        memory = Path("/dev/shm")  # noqa: S108
        self._folder = tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None)
        self._path = Path(self._folder.name) / f"input{self.suffix}"

    def feed(self, data: bytes) -> None:
        """Write the file and read it."""
        self._path.write_bytes(data)
        self.read(self._path)

    @abstractmethod
    def read(self, path: Path) -> None:
        """Read the file."""


def targets() -> dict[str, type[Target]]:
    """Return all targets by name."""
    return {cls.name: cls for cls in classes_by_file("fuzz.targets", Target)}  # type: ignore[type-abstract]
