"""Files that ship with the package: benchmarks, trajectories, reports, the firmware's sources."""

from __future__ import annotations

from pathlib import Path

from agvbench.errors import FileError

INSTALLED = "_lab"
"""The directory inside an installed package that carries them."""
_PACKAGE = Path(__file__).resolve().parent


def resource_directory(name: str) -> Path:
    """Return the directory `name` that ships with agvbench: benchmarks, trajectories, reports or firmware.

    An installed wheel carries them inside the package, a checkout at its top level.

    Raises
    ------
    FileError
        If the installation lacks the directory.
    """
    for root in (_PACKAGE / INSTALLED, _PACKAGE.parent):
        if (root / name).is_dir():
            return root / name
    raise FileError(
        "this installation lacks a directory that ships with agvbench", where=name, remedy="install agvbench again"
    )
