"""The header that tells the vehicle's firmware which calibration it was built for."""

from __future__ import annotations

from pathlib import Path

from agvbench.model import VehicleModel
from agvbench.workflows.writing import write_file


def firmware_header(model: VehicleModel) -> str:
    """Return a C header with the calibration hash of `model`, for ``make CALIBRATION=FILE.h`` in ``firmware/``."""
    name = "".join(letter if letter.isalnum() or letter in " _-" else "_" for letter in model.name)
    return (
        f"/* Calibration of {name}; made by `agvbench calibrate --firmware`. */\n"
        f'#define CALIBRATION_HASH "{model.calibration_hash}"\n'
    )


def write_firmware_header(model: VehicleModel, path: Path) -> None:
    """Write the header of `model`.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = firmware_header(model)
    write_file("--firmware", path, lambda header: header.write_text(text, encoding="ascii", errors="replace"))
