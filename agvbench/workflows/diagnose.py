"""What ``agvbench diagnose`` does: read the campaign, diagnose it, print the answer, and write JSON and vehicle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import tomli_w
from rich.console import Console

from agvbench.campaign import Campaign
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.diagnosis.design.propose import with_first_experiment
from agvbench.errors import FlagError
from agvbench.model import VehicleModel
from agvbench.workflows.diagnosis_files import keep
from agvbench.workflows.output_files import write_file

_RUNS_COUNTED = 5
Progress = Callable[[int, int], AbstractContextManager[Callable[[str], None]]]
"""Given the numbers of runs and frames, shows the lines that it gets while the context lasts."""


def _silent(runs: int, frames: int) -> AbstractContextManager[Callable[[str], None]]:
    return nullcontext(lambda line: None)


def run_diagnose(
    directory: str,
    *,
    show: Callable[[Diagnosis], None],
    json_file: str | None = None,
    out: str | None = None,
    vehicle: str | None = None,
    seed: int = 0,
    next_file: str | None = None,
    drive_next: bool = False,
    next_out: str | None = None,
    rig: Mapping[str, Any] | None = None,
    progress: Progress = _silent,
    wrote: Callable[[str], None] = lambda path: None,
) -> Diagnosis:
    """Diagnose the campaign in `directory`, `show` the answer, and write JSON and the corrected vehicle if asked for.

    With `drive_next` the run that the diagnosis proposes is driven with the `rig`, added to a copy of the campaign, and
    that is diagnosed: what is written and returned is the second answer. ``next_file`` takes the trajectory
    proposed. `progress` is given the numbers of runs and frames, and `wrote` each file that was written.

    Raises
    ------
    CampaignError, FitError, VehicleError
        If the campaign or the vehicle cannot be used.
    PlanError, LinkError, PlantError
        If the next run cannot be driven.
    FileError, FlagError
        If a file cannot be written, or the seed is negative.
    """
    if seed < 0:
        raise FlagError("must not be negative", where="--seed", value=seed)
    campaign = Campaign.open(directory).check()
    vehicle_file = Path(vehicle) if vehicle is not None else campaign.path / "vehicle.toml"
    model = VehicleModel.load(vehicle_file) if vehicle is not None or vehicle_file.exists() else None
    found = _diagnosed(campaign, model, seed, progress)
    show(found)
    if next_file is not None and found.next_experiment is not None:
        trajectory = found.next_experiment.trajectory
        text = tomli_w.dumps(trajectory.to_table())
        write_file("--next", Path(next_file), lambda path: path.write_text(text, encoding="utf-8"))
        wrote(next_file)
    if drive_next:
        found = _decided(campaign, found, show, model, seed, next_out, rig or {}, progress)
    if json_file is not None:
        text = found.to_text()
        write_file("--json", Path(json_file), lambda path: path.write_text(text, encoding="utf-8"))
        keep(found, Path(json_file))
        wrote(json_file)
    if out is not None and found.model is not None:
        write_file("--out", Path(out), found.model.save)
        wrote(out)
    return found


def _diagnosed(campaign: Campaign, model: VehicleModel | None, seed: int, progress: Progress) -> Diagnosis:
    with progress(len(campaign), _frames(campaign)) as on_progress:
        return with_first_experiment(diagnose(campaign, vehicle=model, seed=seed, on_progress=on_progress))


def _frames(campaign: Campaign) -> int:
    """Return about how many frames there are, from a few runs."""
    ids = campaign.run_ids
    some = ids[:: max(1, len(ids) // _RUNS_COUNTED)]
    return round(len(ids) * sum(len(campaign.run(run_id).frames) for run_id in some) / max(1, len(some)))


def _decided(
    campaign: Campaign,
    found: Diagnosis,
    show: Callable[[Diagnosis], None],
    model: VehicleModel | None,
    seed: int,
    out: str | None,
    rig: Mapping[str, Any],
    progress: Progress,
) -> Diagnosis:
    """Drive the run that `found` proposes and return what is then found."""
    from agvbench.workflows.run_next import run_next

    console = Console()
    if found.next_experiment is None:
        console.print("nothing is driven: no run is proposed", highlight=False)
        return found
    extended = run_next(campaign, found.next_experiment, found.model or model, rig, out=out, seed=seed)
    name = found.next_experiment.trajectory.name
    console.print(f"drove {name}; the campaign with it: {extended.path}", highlight=False, soft_wrap=True)
    again = _diagnosed(extended.check(), model, seed, progress)
    show(again)
    return again
