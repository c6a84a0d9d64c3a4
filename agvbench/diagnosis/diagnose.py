"""The diagnosis of a campaign, by the method for its kind of recording."""

from __future__ import annotations

from agvbench.calibration.campaign_protocol import CampaignLike
from agvbench.diagnosis.checks.consistency import require_plausible_units
from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.data.windows import horizon_of
from agvbench.diagnosis.free_driving.method import FreeDriving
from agvbench.diagnosis.method import OnProgress
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.model import VehicleModel


def diagnose(
    campaign: CampaignLike,
    *,
    vehicle: VehicleModel | None = None,
    seed: int = 0,
    on_progress: OnProgress = lambda _: None,
) -> Diagnosis:
    """Diagnose whether static maps describe the vehicle that drove `campaign`, and which effects they lack.

    Parameters
    ----------
    campaign
        Header and runs. If the header has a prediction horizon, or most runs do not begin at rest, they are cut into
        windows.
    vehicle
        The vehicle model before. Effects that it has remain in every model, and are not reported. By default it is
        static maps fitted to the campaign's runs.
    seed
        Seed of the random split into training, validation and test runs, for campaigns without a column ``split``.
    on_progress
        Called with one line of text at each step.

    Raises
    ------
    CampaignError, FitError
        If the campaign is too small, or its tables are inconsistent.
    """
    header, runs = campaign.header, list(campaign)
    context = DiagnosisContext(header, header.geometry, vehicle, seed)
    require_plausible_units(runs, header)
    if (horizon := horizon_of(header, runs)) is not None:
        return FreeDriving(context, on_progress, horizon).diagnose(runs)
    return RunsFromRest(context, on_progress).diagnose(runs)
