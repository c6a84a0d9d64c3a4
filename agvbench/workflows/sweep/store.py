"""``cells.jsonl``: a line for each cell that has ended, appended at once; a line that was cut off is dropped."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Self, TypeVar

import msgspec

from agvbench import __version__
from agvbench.campaign.atomic_files import write_all
from agvbench.errors import FileError, RecordingError
from agvbench.text_files import require_regular
from agvbench.workflows.sweep.cell import MARK, CellResult

SCHEMA = 1
T = TypeVar("T")
MAX_LINE = 4 << 20
_REMEDY = "begin anew without --resume, in another directory"


class Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The first line: what the cells are of. ``grid`` and ``files`` are hashes."""

    schema: int
    agvbench: str
    grid: str
    files: str
    diagnose: bool


class Line(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """A cell that has ended: its result, or why there is none."""

    cell: int
    result: CellResult | None = None
    error: str = ""


class CellStore:
    """The file, open for appending; ``places`` are the bytes at which the newest line of each cell begins."""

    def __init__(self, path: Path, descriptor: int, places: dict[int, int], failed: dict[int, str]) -> None:
        self.path, self.places, self.failed = path, places, failed
        self._descriptor = descriptor

    @classmethod
    def create(cls, directory: Path, header: Header) -> Self:
        """Begin a file."""
        store = cls(directory / MARK, _opened(directory / MARK, os.O_CREAT | os.O_EXCL), {}, {})
        store._append(msgspec.json.encode(header))
        return store

    @classmethod
    def resume(cls, directory: Path, header: Header, cells: int) -> Self:
        """Open a file that was begun with the same `header`, of a grid with that many `cells`.

        Raises
        ------
        FileError
            If there is none, it is of another sweep, or a line of it cannot be read.
        """
        path = directory / MARK
        try:
            require_regular(path)
            places, failed, end = _read(path, header, cells)
        except FileNotFoundError:
            raise FileError("no sweep to resume", where=path, remedy="leave out --resume") from None
        except OSError as error:
            raise FileError("cannot be read", where=path, value=error.strerror) from None
        descriptor = _opened(path)
        os.ftruncate(descriptor, end)
        return cls(path, descriptor, places, failed)

    def add(self, line: Line) -> None:
        """Append a line; it is on the disk when this returns.

        Raises
        ------
        RecordingError
            If the disk refuses.
        """
        _note(line, self._append(msgspec.json.encode(line)), self.places, self.failed)

    def results(self) -> Iterator[tuple[int, CellResult]]:
        """Yield the cells that have a result, in their order; one at a time is in memory."""
        with self.path.open("rb") as file:
            for cell in sorted(self.places):
                file.seek(self.places[cell])
                line = msgspec.json.decode(file.readline(MAX_LINE), type=Line)
                if line.result is not None:
                    yield cell, line.result

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

    def _append(self, text: bytes) -> int:
        try:
            place = os.lseek(self._descriptor, 0, os.SEEK_END)
            write_all(self._descriptor, text + b"\n", durable=True)
        except OSError as error:
            raise RecordingError(
                "cannot be written", where=self.path, value=error.strerror, remedy="free some space, and use --resume"
            ) from None
        return place


def _opened(path: Path, flags: int = 0) -> int:
    try:
        return os.open(path, os.O_WRONLY | flags, 0o644)
    except OSError as error:
        raise RecordingError("cannot be written", where=path, value=error.strerror) from None


def _read(path: Path, header: Header, cells: int) -> tuple[dict[int, int], dict[int, str], int]:
    """Return where the newest line of each cell begins, the causes of failures, and where the last whole line ends."""
    places: dict[int, int] = {}
    failed: dict[int, str] = {}
    end = 0
    with path.open("rb") as file:
        while text := file.readline(MAX_LINE + 1):
            if not text.endswith(b"\n"):
                if len(text) > MAX_LINE:
                    raise FileError("has a line that is too long", where=path, limit=f"{MAX_LINE} bytes")
                break
            if end == 0:
                _require_same(_decoded(text, Header, path, end), header, path)
            else:
                line = _decoded(text, Line, path, end)
                if not 0 <= line.cell < cells:
                    raise FileError(
                        "has a cell that the grid lacks", where=path, value=line.cell, limit=f"below {cells}"
                    )
                _note(line, end, places, failed)
            end += len(text)
    if end == 0:
        raise FileError("no sweep to resume: its first line is missing", where=path, remedy=_REMEDY)
    return places, failed, end


def _note(line: Line, place: int, places: dict[int, int], failed: dict[int, str]) -> None:
    """Take note of a line that begins at `place`: a result counts in place of an earlier failure."""
    if line.error:
        failed[line.cell] = line.error
    else:
        failed.pop(line.cell, None)
        places[line.cell] = place


def _decoded(text: bytes, kind: type[T], path: Path, place: int) -> T:
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise FileError(
            "holds no sweep to resume",
            where=f"{path}: byte {place}",
            value=" ".join(str(error).split()),
            remedy=_REMEDY,
        ) from None


def _require_same(found: Header, wanted: Header, path: Path) -> None:
    what = {
        "schema": "has another schema",
        "agvbench": "was begun with another version of agvbench",
        "grid": "is of another grid",
        "files": "was begun with other files in this folder",
        "diagnose": "was begun with another --diagnose",
    }
    for name, text in what.items():
        was, now = getattr(found, name), getattr(wanted, name)
        if was != now:
            raise FileError(text, where=path, value=str(was)[:12], limit=str(now)[:12], remedy=_REMEDY)


def header(grid: str, files: str, *, diagnose: bool) -> Header:
    """Return the first line of a sweep that begins now."""
    return Header(SCHEMA, __version__, grid, files, diagnose)
