"""The stages of a loop between its two sessions: what is diagnosed, learned and planned, each kept in a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agvbench.campaign.atomic_files import replace_whole
from agvbench.errors import FileError, FitError
from agvbench.loop.corrections import plans_of
from agvbench.loop.sessions import OnProgress, drive, moved
from agvbench.loop.settings import (
    BEFORE,
    BIAS_CORRECTIONS,
    DIAGNOSIS,
    FIRST_BIAS_CORRECTIONS,
    MODEL_ONLY,
    NO_TRIAL,
    PLANS,
    TRIAL,
    VEHICLE,
    write,
)
from agvbench.model import VehicleModel
from agvbench.planning import driven_trajectories
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.session.end_pose_bias import read_bias_corrections
from agvbench.text_files import read_json
from agvbench.workflows.diagnosis_files import keep_residuals

if TYPE_CHECKING:
    from agvbench.diagnosis import Diagnosis

TRYING = ("trial",)
"""What is driven between the sessions: corrected plans, for what they still miss."""


def drive_corrected(
    directory: Path, session: str, names: Sequence[str], settings: BenchSettings, learned: str, on_progress: OnProgress
) -> None:
    """Drive a session with what was found and learned."""
    models = {
        "calibration": str((directory / BEFORE / VEHICLE).resolve()),
        "corrected": str((directory / VEHICLE).resolve()),
        "remainders": str(Path(learned).resolve()) if learned else "",
    }
    moved(directory / session, models)
    drive(directory / session, names, settings, models, on_progress)


def diagnosed(directory: Path, seed: int, on_progress: OnProgress) -> dict[str, Any]:
    """Return the diagnosis, after writing it and the corrected vehicle, unless they are there already."""
    from agvbench.campaign import Campaign
    from agvbench.diagnosis import diagnose

    path, vehicle = directory / DIAGNOSIS, directory / VEHICLE
    if path.exists() and vehicle.exists():
        content = _read(path)
        on_progress(f"    {content['verdict']}, as found before")
        return content
    calibrated = VehicleModel.load(directory / BEFORE / VEHICLE) if (directory / BEFORE / VEHICLE).exists() else None
    found = diagnose(
        Campaign.open(directory / BEFORE).check(), vehicle=calibrated, seed=seed, on_progress=lambda line: None
    )
    model = found.model or calibrated
    if model is None:
        raise FitError("nothing to correct with", where=directory / BEFORE, value=found.why)
    for line in _in_words(found):
        on_progress(f"    {line}")
    replace_whole(vehicle, model.save)
    keep_residuals(found, directory)
    write(path, found.to_text())
    return _read(path)


def _in_words(found: Diagnosis) -> list[str]:
    from agvbench.workflows.diagnosis_files import effect_in_words

    lines = [f"{found.verdict}: {found.why}", *(effect_in_words(effect) for effect in found.effects)]
    if found.model is None:
        return [*lines, "no effect can be corrected: the condition corrected drives the calibrated maps"]
    if found.depends_on:
        covariates = ", ".join(d.covariate for d in found.depends_on[:3])
        lines.append(f"what no effect explains is not corrected; it depends on {covariates}")
    if not found.effects:
        lines.append("no effect was named: the condition corrected drives maps fitted again")
    return lines


def learned(directory: Path, settings: BenchSettings, on_progress: OnProgress) -> str:
    """Return the file of the corrected model's end-pose bias, after learning it unless it is there; "" for nothing.

    First from the calibrated runs of the first session; then corrected plans are tried, for an effect that the model
    lacks does something else on another way.
    """
    from agvbench.campaign import Campaign
    from agvbench.loop.corrections import bias_corrections

    path = directory / BIAS_CORRECTIONS
    if settings.remainders == MODEL_ONLY:
        on_progress("3/5 corrected plans are not tried: --model-only")
        return ""
    if path.exists():
        on_progress(f"3/5 what corrected plans miss was learned before: {path}")
        return str(path)
    model = VehicleModel.load(directory / VEHICLE)
    known = bias_corrections(Campaign.open(directory / BEFORE), model, "calibrated")
    if settings.remainders == NO_TRIAL:
        on_progress("3/5 corrected plans are not tried: --no-trial")
    else:
        on_progress(f"3/5 trying corrected plans, for what they still miss → {directory / TRIAL}")
        _write_bias_corrections(directory / FIRST_BIAS_CORRECTIONS, known)
        drive_corrected(directory, TRIAL, TRYING, settings, str(directory / FIRST_BIAS_CORRECTIONS), on_progress)
        known |= bias_corrections(Campaign.open(directory / TRIAL), model, "corrected")
    _write_bias_corrections(path, known)
    return str(path)


def _write_bias_corrections(path: Path, known: Mapping[str, Mapping[str, float]]) -> None:
    write(path, json.dumps({"schema": 1, "remainders": known}, indent=2, allow_nan=False) + "\n")


def planned(directory: Path, settings: BenchSettings, learned: str, on_progress: OnProgress) -> dict[str, Any]:
    """Return what corrected plans compensate, after writing it, unless it is there already."""
    path = directory / PLANS
    if not path.exists():
        model, bias = VehicleModel.load(directory / VEHICLE), read_bias_corrections(learned)
        names = driven_trajectories(settings.trajectories)
        content = plans_of(model, settings.workspace, bias, names, settings.steering)
        write(path, json.dumps({"schema": 1, "plans": content}, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    plans: dict[str, Any] = _read(path)["plans"]
    for name, entry in plans.items():
        if entry.get("problem"):
            on_progress(f"    {name}: {entry['problem']}")
        for sentence in entry.get("said", ()):
            on_progress(f"    {name}: {sentence}")
    return plans


def _read(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = read_json(path)
    except (OSError, ValueError) as error:
        raise FileError(
            "cannot be read", where=path, value=error, remedy="delete it; --resume makes it again"
        ) from None
    return content
