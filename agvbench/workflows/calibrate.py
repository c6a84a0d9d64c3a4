"""What ``agvbench calibrate`` does: measure the calibration runs, fit both ways, and write the vehicle."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

from rich.console import Console

from agvbench.calibration import Calibration, calibrate
from agvbench.campaign import Campaign
from agvbench.workflows.writing import write_file


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
