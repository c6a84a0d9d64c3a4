"""Files that ship with the package: benchmarks, trajectories, reports."""

from __future__ import annotations

from pathlib import Path

from agvbench.errors import FileError

_PACKAGE = Path(__file__).resolve().parent


def resource_directory(name: str) -> Path:
    """Return the directory `name` (``"benchmarks"``, ``"trajectories"`` or ``"reports"``) that ships with agvbench.

    An installed wheel carries them inside the package, a checkout at its top level.

    Raises
    ------
    FileError
        If the installation lacks the directory.
    """
    for root in (_PACKAGE / "_lab", _PACKAGE.parent):
        if (root / name).is_dir():
            return root / name
    raise FileError(
        "this installation lacks a directory that ships with agvbench", where=name, remedy="install agvbench again"
    )
