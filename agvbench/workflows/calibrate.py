"""``agvbench calibrate``: measure the calibration runs, fit both ways, write vehicle and firmware header."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

from rich.console import Console

from agvbench.calibration import Calibration, calibrate
from agvbench.campaign import Campaign
from agvbench.model import VehicleModel
from agvbench.workflows.output_files import write_file


def calibrated(directory: str, *, maps: str = "default", session: str | None = None) -> Calibration:
    """Return the calibration from the campaign in `directory`; a terminal shows that something goes on.

    Raises
    ------
    CampaignError, FitError, VehicleError
        If the campaign cannot be read or does not determine the maps.
    """
    errors = Console(stderr=True)
    with errors.status("measuring runs and fitting maps") if errors.is_terminal else nullcontext():
        return calibrate(Campaign.open(directory), maps=maps, session=session)


def save(calibration: Calibration, path: Path) -> None:
    """Write the calibrated vehicle.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_file("--out", path, calibration.model.save)


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
