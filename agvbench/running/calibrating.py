"""Calibrate in the middle of a session: from the campaign's calibration runs to the calibrated vehicle model."""

from __future__ import annotations

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.errors import AgvbenchError, FitError
from agvbench.model import VehicleModel

VEHICLE_FILE = "vehicle.toml"
MEASUREMENTS_TABLE = "calibration"


def calibrate_campaign(writer: CampaignWriter, *, maps: str) -> VehicleModel:
    """Fit the static maps from what `writer` recorded so far; keep model and measurements beside the campaign.

    Raises
    ------
    FitError
        If the campaign's calibration runs do not determine the maps.
    """
    from agvbench.calibration import calibrate

    try:
        calibration = calibrate(Campaign.open(writer.path), maps=maps)
    except AgvbenchError as error:
        raise FitError(
            f"cannot calibrate ({error})",
            where=writer.path,
            remedy="drive bench_calibration.py first, or give --calibration FILE",
        ) from None
    calibration.model.save(writer.path / VEHICLE_FILE)
    writer.write_table(MEASUREMENTS_TABLE, calibration.measurements)
    return calibration.model
