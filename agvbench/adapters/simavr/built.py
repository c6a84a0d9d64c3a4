"""Where the built firmware is, and what is missing if it is not."""

from __future__ import annotations

import shutil
from pathlib import Path

from agvbench.errors import AgvbenchError, FileError, LinkError
from agvbench.resources import resource_directory

PACKAGES = {
    "make": "make",
    "cc": "gcc",
    "/usr/include/pty.h": "libc6-dev",
    "avr-gcc": "gcc-avr",
    "/usr/lib/avr/include/avr/io.h": "avr-libc",
    "simavr": "simavr",
    "/usr/include/simavr/sim_avr.h": "libsimavr-dev",
}
"""Debian's packages by what shows that they are there: a program or a file."""
VERSIONS = ("1", "2")
HOST = "simavr_host"


def missing_packages() -> list[str]:
    """Return the system packages that building the firmware and its host needs and this machine lacks."""
    return [package for sign, package in PACKAGES.items() if not (shutil.which(sign) or Path(sign).exists())]


def built(name: str) -> Path:
    """Return the file `name` (``"agv2.elf"``, ``"simavr_host"``) that ``make`` leaves in ``firmware/build``.

    Raises
    ------
    LinkError
        If it is not built, naming the system packages that this lacks, if any.
    """
    try:
        path = resource_directory("firmware") / "build" / name
    except FileError as error:
        raise LinkError(
            "this installation comes without the firmware's sources",
            where="simavr",
            remedy="run from a checkout of agvbench",
        ) from error
    if path.is_file():
        return path
    lacking = missing_packages()
    remedy = f"install {' '.join(lacking)}, then run nox -s firmware" if lacking else "run nox -s firmware"
    raise LinkError("the firmware or its host is not built", where="simavr", value=path.name, remedy=remedy)


def why_not_built(version: str = "2") -> str:
    """Return why the firmware of `version` cannot run here, ``""`` if it can: a reason to skip."""
    try:
        built(f"agv{version}.elf"), built(HOST)
    except AgvbenchError as error:
        return str(error)
    return ""
