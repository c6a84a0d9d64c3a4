"""The firmware, built from the sources as they are; skipped where the tools are missing, saying which."""

from __future__ import annotations

import fcntl
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from agvbench.adapters.simavr.firmware_files import missing_packages
from agvbench.adapters.simavr.microcontroller import Microcontroller

FIRMWARE = Path(__file__).parents[2] / "firmware"


@pytest.fixture(scope="session")
def firmware() -> Path:
    """The directory with both versions and their host built."""
    if missing := missing_packages():
        pytest.skip(f"not installed: {' '.join(missing)}")
    with (Path(tempfile.gettempdir()) / "agvbench-firmware.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # tests run in several processes, the first of them builds
        subprocess.run(["make", "-s", "-C", FIRMWARE], check=True, stdout=subprocess.DEVNULL)
    return FIRMWARE


@pytest.fixture
def version_1(firmware: Path) -> Iterator[Microcontroller]:
    microcontroller = Microcontroller("1")
    yield microcontroller
    microcontroller.close()


@pytest.fixture
def version_2(firmware: Path) -> Iterator[Microcontroller]:
    microcontroller = Microcontroller("2")
    yield microcontroller
    microcontroller.close()


@pytest.fixture(params=["1", "2"])
def microcontroller(firmware: Path, request: pytest.FixtureRequest) -> Iterator[Microcontroller]:
    microcontroller = Microcontroller(request.param)
    yield microcontroller
    microcontroller.close()
