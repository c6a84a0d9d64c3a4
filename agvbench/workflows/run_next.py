"""``agvbench diagnose --run-next``: drive the run that a diagnosis asks for, and diagnose again with it.

Nothing that is recorded is touched. The extended campaign is a new directory: every run of the old one, the new ones
after them in a session of their own, and the bench session that drove these in ``driven``.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Collection, Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.diagnosis.proposal import NextExperiment
from agvbench.errors import FileError, PlanError
from agvbench.metrics.table import FILE as ERRORS
from agvbench.model import VehicleModel
from agvbench.planning import plan
from agvbench.running.configuration.settings import SETTINGS_FILE, BenchSettings
from agvbench.running.execution.run_records import RunRequest
from agvbench.running.session.opening import open_session
from agvbench.types import Run
from agvbench.workflows.diagnosis_files import RESIDUALS

DRIVEN = "driven"
SESSION = "next"
# What decides which runs are driven, and by which models, is not the campaign's: the diagnosis says so.
_OF_THE_CAMPAIGN = frozenset({
    "vehicle", "calibration", "corrected", "remainders", "maps",
    "repeats", "order", "full", "benchmarks", "only", "session",
})  # fmt: skip
_TABLES = {"runs", "commands", "poses"}
_OF_BEFORE = {"campaign.toml", RESIDUALS, ERRORS}


def run_next(
    campaign: Campaign,
    experiment: NextExperiment,
    model: VehicleModel | None,
    rig: Mapping[str, Any],
    *,
    out: str | Path | None = None,
    seed: int = 0,
) -> Campaign:
    """Drive `experiment` and return the campaign extended by its runs.

    Parameters
    ----------
    campaign
        What was diagnosed; it stays as it is.
    experiment
        What the diagnosis proposes.
    model
        The vehicle as diagnosed, which the floor is checked with; by default the session's nominal one.
    rig
        Options of the bench (``agv``, ``mocap``, ``plant``, ``seed``, …) that differ from those which the campaign was
        driven with (its ``bench.toml``).
    out
        Directory of the extended campaign, which must not exist; by default beside the old one, ``-next`` behind its
        name.
    seed
        That of the diagnosis: its test runs remain test runs.

    Raises
    ------
    FileError
        If `out` is occupied or cannot be written.
    PlanError, LinkError, PlantError
        If the run does not fit the floor, or driving failed.
    """
    target = _free_directory(campaign.path, out)
    driven = target / DRIVEN
    runs, refused = _driven(experiment, model, _options(campaign.path, rig), driven, set(campaign.run_ids))
    if not runs:
        raise PlanError(
            "no attempt at the next run counted",
            where=experiment.trajectory.name,
            value=refused,
            remedy=f"see {driven}",
        )
    # What is copied here is safe where it came from.
    writer = CampaignWriter.create(target / "making", campaign.header, durable=False)
    for run in (*_kept(campaign, seed), *_later(runs, campaign)):
        writer.append(run)
    _settle(target)
    _copy_what_else(campaign.path, target)
    return Campaign.open(target)


def _free_directory(path: Path, out: str | Path | None) -> Path:
    if out is None:
        name = path.resolve().name
        places = (path.resolve().with_name(f"{name}-next{k or ''}") for k in (0, *range(2, 1000)))
        target = next(place for place in places if not place.exists())
    else:
        target = Path(out)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise FileError("is occupied", where=target, remedy="name a new directory with --next-out")
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError("cannot be written", where=target, value=error.strerror, remedy="see --next-out") from None
    return target


def _options(path: Path, rig: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of the session: those of the campaign's own bench, and what was asked for instead."""
    saved = dataclasses.asdict(BenchSettings.load(path)) if (path / SETTINGS_FILE).exists() else {}
    options = {name: value for name, value in saved.items() if name not in _OF_THE_CAMPAIGN}
    if (path / "vehicle.toml").exists():
        options["vehicle"] = str(path / "vehicle.toml")
    return options | {name: value for name, value in rig.items() if value is not None}


def _earlier(campaign: Campaign) -> list[Run]:
    """Return the runs that were driven for earlier proposals."""
    return [run for run in campaign if (run.session or "").startswith(SESSION)]


def _driven(
    experiment: NextExperiment,
    model: VehicleModel | None,
    options: dict[str, Any],
    driven: Path,
    taken: Collection[str],
) -> tuple[list[Run], str]:
    """Return the repeats that count, and why the last that does not was refused; no id begins as one that is taken."""
    trajectory = experiment.trajectory
    runs: list[Run] = []
    refused = ""
    with open_session(options, out=str(driven), resume=False, dry_run=False) as session:
        free = (name for name in _names(trajectory.name) if not any(run_id.startswith(name) for run_id in taken))
        for repeat, run_id in zip(range(1, experiment.repeats + 1), free, strict=False):
            start = experiment.starts[(repeat - 1) % len(experiment.starts)] if experiment.starts else None
            planned = plan(trajectory, model or session.nominal, workspace=session.workspace, start=start)
            request = RunRequest(
                run_id=run_id,
                experiment=trajectory.experiment,
                trajectory=trajectory.name,
                condition="calibrated",
                repeat=repeat,
                commands=planned.commands,
                target=planned.target,
                start=planned.start,
            )
            run = session.run(request, planned)
            if run.is_ok:
                runs.append(run)
            else:
                refused = run.status
    return runs, refused


def _names(stem: str) -> Iterator[str]:
    return (f"{stem}-{number:02d}" for number in count(1))


def _kept(campaign: Campaign, seed: int) -> Iterator[Run]:
    """Return the runs as they are, with the split that they were diagnosed by written down."""
    runs = list(campaign)
    if any(run.split for run in runs):
        yield from runs
        return
    header = campaign.header
    readings = read_runs(runs, header.neutral, turns_on_the_spot=header.geometry.is_differential)
    split = split_runs(readings.runs, readings.group, campaign.header.neutral, seed)
    names = dict(zip((run.run_id for run in readings.runs), split.names, strict=True))
    for run in runs:
        yield dataclasses.replace(run, split=names.get(run.run_id, "fit"))


def _later(runs: list[Run], campaign: Campaign) -> Iterator[Run]:
    """Return the new runs after the old ones, in a session of their own, to be fitted."""
    begin = max((run.started_s for run in campaign), default=0.0) + 3600.0
    number = len({run.session for run in _earlier(campaign)}) + 1
    for run in runs:
        yield dataclasses.replace(run, started_s=begin + run.started_s, session=f"{SESSION}{number}", split="fit")


def _settle(target: Path) -> None:
    """Move the finished campaign out of the folder in which it was made: a campaign is whole or not there."""
    making = target / "making"
    heads = sorted(making.iterdir(), key=lambda path: path.name == "campaign.toml")
    for path in heads:
        path.rename(target / path.name)
    making.rmdir()


def _copy_what_else(path: Path, target: Path) -> None:
    """Copy settings, vehicle and further tables, but neither report nor diagnosis: those are of the campaign before."""
    for item in sorted(path.iterdir()):
        stem = item.name.partition(".")[0]
        if stem in _TABLES or item.name in _OF_BEFORE or (target / item.name).exists():
            continue
        if item.is_file() and item.suffix in {".toml", ".parquet", ".csv"}:
            shutil.copy2(item, target / item.name)
