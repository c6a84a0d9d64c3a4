"""The diagnosis of a campaign, by the method for its kind of recording."""

from __future__ import annotations

from os import PathLike

from agvbench.calibration.campaign_protocol import CampaignLike
from agvbench.campaign.arguments import as_campaign
from agvbench.diagnosis.checks.consistency import require_plausible_units
from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.data.windows import horizon_of
from agvbench.diagnosis.free_driving.method import FreeDriving
from agvbench.diagnosis.method import OnProgress
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.model import VehicleModel


def diagnose(
    campaign: CampaignLike | str | PathLike[str],
    *,
    vehicle: VehicleModel | None = None,
    seed: int = 0,
    on_progress: OnProgress = lambda _: None,
) -> Diagnosis:
    """Diagnose whether static maps describe the vehicle that drove `campaign`, and which effects they lack.

    Parameters
    ----------
    campaign
        A campaign, or its directory. If the header has a prediction horizon, or most runs do not begin at rest, runs
        are cut into windows.
    vehicle
        The vehicle model before. Effects that it has remain in every model, and are not reported. By default it is
        static maps fitted to the campaign's runs.
    seed
        Seed of the random split into training, validation and test runs, for campaigns without a column ``split``.
    on_progress
        Called with one line of text at each step.

    Raises
    ------
    InputError
        If `campaign` is no campaign.
    CampaignError, FitError
        If the campaign cannot be read, is too small, or its tables are inconsistent.
    """
    opened = as_campaign(campaign)
    header, runs = opened.header, list(opened)
    context = DiagnosisContext(header, header.geometry, vehicle, seed)
    require_plausible_units(runs, header)
    if (horizon := horizon_of(header, runs)) is not None:
        return FreeDriving(context, on_progress, horizon).diagnose(runs)
    return RunsFromRest(context, on_progress).diagnose(runs)
