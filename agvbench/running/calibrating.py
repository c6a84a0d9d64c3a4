"""Calibrate in the middle of a session: from the campaign's calibration runs to the calibrated vehicle model."""

from __future__ import annotations

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.errors import AgvbenchError, FitError
from agvbench.model import VehicleModel

VEHICLE_FILE = "vehicle.toml"
MEASUREMENTS_TABLE = "calibration"


def calibrate_campaign(writer: CampaignWriter, *, maps: str) -> VehicleModel:
    """Fit the static maps from what `writer` recorded so far; keep model and measurements beside the campaign.

    What was fitted before an interruption is taken as it is: runs driven before and after belong to one calibration.

    Raises
    ------
    FitError
        If the campaign's calibration runs do not determine the maps.
    VehicleError
        If the model kept beside the campaign cannot be read.
    RecordingError
        If the disk refuses.
    """
    from agvbench.calibration import calibrate

    if (writer.path / VEHICLE_FILE).exists():
        return VehicleModel.load(writer.path / VEHICLE_FILE)
    try:
        calibration = calibrate(Campaign.open(writer.path), maps=maps)
    except AgvbenchError as error:
        raise FitError(
            f"cannot calibrate ({error})",
            where=writer.path,
            remedy="drive bench_calibration.py first, or give --calibration FILE",
        ) from None
    writer.write_table(MEASUREMENTS_TABLE, calibration.measurements)
    writer.write_beside(VEHICLE_FILE, calibration.model.save)
    return calibration.model
