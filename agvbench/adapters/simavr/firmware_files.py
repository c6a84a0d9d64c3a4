"""The files of the built firmware, and what is missing if it is not built."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from agvbench import __version__
from agvbench.errors import AgvbenchError, LinkError
from agvbench.resources import INSTALLED, resource_directory

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


def firmware_sources() -> Path:
    """Return the directory of the sources that ship with agvbench."""
    return resource_directory("firmware")


def build_directory() -> Path:
    """Return where the firmware is built to: beside its sources in a checkout, else in the user's cache."""
    sources = firmware_sources()
    if sources.parent.name != INSTALLED:
        return sources / "build"
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "agvbench" / f"firmware-{__version__}"


def built(name: str) -> Path:
    """Return the file `name` (``"agv2.elf"``, ``"simavr_host"``) as ``agvbench firmware`` built it.

    Raises
    ------
    LinkError
        If it is not built, naming the system packages that this lacks, if any.
    """
    path = build_directory() / name
    if path.is_file():
        return path
    lacking = missing_packages()
    remedy = f"install {' '.join(lacking)}, then run agvbench firmware" if lacking else "run agvbench firmware"
    raise LinkError("the firmware or its host is not built", where="simavr", value=path.name, remedy=remedy)


def why_not_built(version: str = "2") -> str:
    """Return why the firmware of `version` cannot run here, ``""`` if it can: a reason to skip."""
    try:
        built(f"agv{version}.elf"), built(HOST)
    except AgvbenchError as error:
        return str(error)
    return ""
