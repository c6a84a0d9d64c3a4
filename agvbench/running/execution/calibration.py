"""Calibrate in the middle of a session: from the campaign's calibration runs to the calibrated vehicle model."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.campaign.manifest import PLANNED_TABLE
from agvbench.errors import AgvbenchError, FitError, VehicleError
from agvbench.model import VehicleModel
from agvbench.model.priors import Prior
from agvbench.running.configuration.provenance import recorded_rows
from agvbench.running.execution.run_records import attempts_by_run
from agvbench.types import CALIBRATION_EXPERIMENTS, Outcome, Run

VEHICLE_FILE = "vehicle.toml"
MEASUREMENTS_TABLE = "calibration"
RUNS_DIGEST = "calibration_runs_sha256"
"""The entry of a model's provenance that says from which runs a bench calibrated it."""


def calibrate_campaign(
    writer: CampaignWriter, *, maps: str, awaited: Collection[str] = (), priors: tuple[Prior, ...] = ()
) -> VehicleModel:
    """Fit the static maps from what `writer` recorded so far; keep model and measurements beside the campaign.

    ``awaited`` are calibration runs of the session that are still to be driven: there must be none. A model that was
    kept is taken if it was fitted from the very runs that the campaign has, or if runs were driven with it. A fitted
    model has the ``priors`` of the nominal vehicle.

    Raises
    ------
    FitError
        If calibration runs are missing, or do not determine the maps.
    VehicleError
        If the model kept beside the campaign cannot be read.
    RecordingError
        If the disk refuses.
    """
    from agvbench.calibration import calibrate

    try:
        campaign = Campaign.open(writer.path)
        used = _calibration_runs(campaign)
        digest = hashlib.sha256("\n".join(used).encode()).hexdigest()
        if (kept := _kept_model(writer, campaign, digest)) is not None:
            return kept
        if awaited:
            value = f"{len(awaited)} calibration runs were not driven, {min(awaited)} among them"
            raise FitError("the calibration is not complete", value=value)
        if not used:
            raise FitError("no calibration run counts")
        calibration = calibrate(campaign, maps=maps)
    except VehicleError:
        raise
    except AgvbenchError as error:
        raise FitError(
            f"cannot calibrate ({error})",
            where=writer.path,
            remedy="drive bench_calibration.py too, or begin a session with --calibration FILE",
        ) from None
    model = replace(calibration.model, provenance={**calibration.model.provenance, RUNS_DIGEST: digest}, priors=priors)
    writer.write_table(MEASUREMENTS_TABLE, calibration.measurements)
    writer.write_beside(VEHICLE_FILE, model.save)
    return model


def unfinished_calibration(directory: Path, recorded: Mapping[str, Run], attempts: int) -> set[str]:
    """Return the planned calibration runs of the campaign in `directory` that its earlier sessions did not finish.

    A run is finished if one of its ``recorded`` attempts counts, or if all its ``attempts`` were rejected.

    Raises
    ------
    CampaignError
        If the campaign's plan is damaged.
    """
    rows = recorded_rows(directory, PLANNED_TABLE)
    planned = {str(row["run_id"]) for row in rows if row["experiment"] in CALIBRATION_EXPERIMENTS}
    attempts_at = attempts_by_run(recorded.values())
    tried = {run_id: attempts_at.get(run_id, []) for run_id in planned}
    return {
        run_id
        for run_id, runs in tried.items()
        if not any(run.is_ok for run in runs) and sum(run.outcome is Outcome.REJECTED for run in runs) < attempts
    }


def _kept_model(writer: CampaignWriter, campaign: Campaign, digest: str) -> VehicleModel | None:
    """Return the model beside the campaign, or None where there is none or it is of other calibration runs."""
    path = writer.path / VEHICLE_FILE
    if not path.exists():
        return None
    model = VehicleModel.load(path)
    was_driven = any(run.condition == "calibrated" and run.is_ok for run in campaign)
    return model if was_driven or model.provenance.get(RUNS_DIGEST) == digest else None


def _calibration_runs(campaign: Campaign) -> list[str]:
    """Return the ids of the calibration runs that count, in order."""
    return sorted(run.run_id for run in campaign if run.is_ok and run.experiment in CALIBRATION_EXPERIMENTS)
