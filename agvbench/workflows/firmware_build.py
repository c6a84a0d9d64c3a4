"""Build the firmware and the simulated microcontroller from the sources that ship with agvbench."""

from __future__ import annotations

import subprocess
from pathlib import Path

from agvbench.adapters.simavr.firmware_files import build_directory, firmware_sources, missing_packages
from agvbench.errors import FileError, LinkError

_LIMIT_S = 300.0


def build_firmware(calibration: Path | None = None, out: Path | None = None) -> tuple[Path, str]:
    """Build both versions and the host of the simulated one.

    Parameters
    ----------
    calibration
        A header as `agvbench calibrate --firmware` writes it.
    out
        Where to; by default where ``--agv simavr`` looks.

    Returns
    -------
    The directory, and what the build says of sizes and stack.

    Raises
    ------
    LinkError
        If system packages are missing, or the sources cannot be built.
    FileError
        If there is no such header, or the directory cannot be written.
    """
    if missing := missing_packages():
        raise LinkError(
            "tools are missing", where="firmware", value=" ".join(missing),
            remedy=f"on Debian: sudo apt-get install {' '.join(missing)}",
        )  # fmt: skip
    directory = (out or build_directory()).absolute()
    if calibration is not None and not calibration.is_file():
        raise FileError("no such file", where=calibration, remedy="agvbench calibrate DIR --firmware FILE.h writes one")
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError("cannot be written", where=directory, value=error.strerror, remedy="give --out") from None
    return directory, _made(directory, calibration)


def _made(directory: Path, calibration: Path | None) -> str:
    command = ["make", "-s", "-C", str(firmware_sources()), f"BUILD={directory}"]
    command += [] if calibration is None else [f"CALIBRATION={calibration.absolute()}"]
    try:
        done = subprocess.run(  # noqa: S603  (our own Makefile)
            command, capture_output=True, encoding="utf-8", errors="replace", check=False, timeout=_LIMIT_S
        )
    except subprocess.TimeoutExpired:
        raise LinkError("the build does not end", where="firmware", limit=f"{_LIMIT_S:g} s") from None
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines() or [""]
        raise LinkError("the sources cannot be built", where="firmware", value=said[0][:200])
    return done.stdout.strip()
