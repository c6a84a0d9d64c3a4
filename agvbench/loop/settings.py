"""The settings of a loop and the names of its files, so that it can go on after an interruption."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import tomli_w

from agvbench.campaign.atomic_files import write_atomically
from agvbench.errors import FileError, FlagError
from agvbench.running.configuration.campaign_directory import CAMPAIGNS, newest
from agvbench.running.configuration.settings import BenchSettings, settings_for_resume
from agvbench.running.configuration.vehicles import default_plant, lab_vehicle

SETTINGS = "loop.toml"
BEFORE, DIAGNOSIS, VEHICLE, PLANS, AFTER = "before", "diagnosis.json", "vehicle.toml", "plans.json", "after"
TRIAL, BIAS_CORRECTIONS, FIRST_BIAS_CORRECTIONS = "trial", "remainders.json", "remainders-before.json"
MODEL_ONLY, NO_TRIAL = "none", "before"
"""What `BenchSettings.remainders` says of a loop: plans of the model alone, or learned from the first session alone."""


def opened(given: Mapping[str, Any], out: str | None, *, resume: bool) -> tuple[Path, BenchSettings]:
    """Return the loop's directory and settings: new ones, or with `resume` those of the loop that goes on.

    Raises
    ------
    FlagError
        If there is nothing to resume, a loop is there already, or an option contradicts the loop that goes on.
    FileError
        If the directory cannot be made or its settings not be read.
    """
    options = {name: value for name, value in given.items() if value is not None}
    if resume:
        directory = Path(out) if out is not None else newest(SETTINGS, "loop")
        return directory, settings_for_resume(BenchSettings.read(directory / SETTINGS, "loop"), options)
    directory = Path(out) if out is not None else CAMPAIGNS / datetime.now().astimezone().strftime("loop-%Y%m%d-%H%M%S")
    settings = BenchSettings.given({"plant": default_plant(options.get("vehicle", lab_vehicle())), **options})
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        remedy = "go on with --resume" if (directory / SETTINGS).exists() else "choose another directory"
        raise FlagError("exists already and is not empty", where="--out", value=directory, remedy=remedy)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError("cannot be made", where=directory, value=error.strerror, remedy="choose another") from None
    write(directory / SETTINGS, tomli_w.dumps(asdict(settings)))
    return directory, settings


def write(path: Path, text: str) -> None:
    """Write a file that is either whole or not there.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    try:
        write_atomically(path, text.encode())
    except OSError as error:
        raise FileError("cannot be written", where=path, value=error.strerror) from None
