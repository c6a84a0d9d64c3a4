"""Files of the current folder that decide what a cell drives: every worker must have the same ones.

A bench finds vehicle, trajectories, benchmarks, metrics and effects in its folder. On another machine another folder
would give other results without a word. So the client states the folder and the hash of these files, and a worker
whose folder has others runs nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from agvbench.errors import AgvbenchError
from agvbench.workflows.sweep.grid import Grid

_FOUND = (
    "vehicle.toml",
    "trajectories/*.toml",
    "benchmarks/bench_*.py",
    "benchmarks/conftest.py",
    "metrics/*.py",
    "effects/*.py",
)
_FILE_OPTIONS = ("vehicle", "calibration", "corrected", "remainders")


class LabFiles(msgspec.Struct, frozen=True):
    """The folder in which cells are driven, its files, and one SHA-256 over all of them."""

    folder: str
    files: tuple[str, ...]
    sha256: str

    @classmethod
    def of(cls, grid: Grid, folder: Path) -> LabFiles | None:
        """Return the files that `grid` uses in `folder`; None where it needs none, and any folder will do."""
        files = sorted({str(path) for path in _files(grid, folder)})
        return cls(str(folder), tuple(files), _hash(folder, files)) if files else None

    def require_here(self) -> None:
        """Raise `AgvbenchError` unless this machine has the same files in the same folder."""
        try:
            same = _hash(Path(self.folder), self.files) == self.sha256
        except OSError:
            same = False
        if not same:
            raise AgvbenchError(
                "worker does not have the files of the sweep's folder", where=self.folder,
                value=", ".join(self.files[:3]), remedy="share the folder under the same path, and do not change it",
            )  # fmt: skip


def _files(grid: Grid, folder: Path) -> Iterator[Path]:
    """Yield the files that there are, relative to `folder` if they lie in it."""
    for pattern in _FOUND:
        yield from (path.relative_to(folder) for path in folder.glob(pattern))
    named = [name.partition("::")[0] for name in grid.benchmarks]
    for option in _FILE_OPTIONS:
        named += _values(grid, option)
    for names in _values(grid, "trajectories"):
        named += names.split(",")
    yield from (Path(name) for name in named if name and (folder / name).is_file())
    for plant in _values(grid, "plant"):
        yield from _plant_files(plant.rpartition(":")[0], folder)


def _values(grid: Grid, option: str) -> list[str]:
    """Return every value that an option has in the grid."""
    on_axes = [str(value) for axis in grid.axes if axis.option == option for value in axis.values]
    return [*on_axes, str(grid.fixed.get(option, ""))]


def _plant_files(source: str, folder: Path) -> Iterator[Path]:
    """Yield the file of a plant with its neighbours, which it may import; or the module of that name in the folder."""
    if not source:
        return
    if (folder / source).is_file():
        beside = (folder / source).parent.glob("*.py")
        yield from (path.relative_to(folder) if path.is_relative_to(folder) else path for path in beside)
        return
    root = source.partition(".")[0]
    if (folder / f"{root}.py").is_file():
        yield Path(f"{root}.py")
    yield from (path.relative_to(folder) for path in (folder / root).rglob("*.py"))


def _hash(folder: Path, files: Iterable[str]) -> str:
    found = hashlib.sha256()
    for name in files:
        digest = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        found.update(f"{digest}  {name}\n".encode())
    return found.hexdigest()
