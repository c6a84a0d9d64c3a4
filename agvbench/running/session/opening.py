"""Open a bench session: settings, vehicle, rig and campaign; new, resumed, or on paper only."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from agvbench.adapters import check_specs
from agvbench.bus.link import VehicleLink
from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter
from agvbench.campaign.header import FILE_NAME, schema_for
from agvbench.campaign.lock import locked
from agvbench.campaign.manifest import PLANNED_TABLE
from agvbench.campaign.writer import refuse_occupied
from agvbench.errors import CampaignError, RecordingError
from agvbench.labels import labels_given
from agvbench.model import VehicleModel
from agvbench.planning import Workspace
from agvbench.running.configuration.campaign_directory import choose_directory, has_runs
from agvbench.running.configuration.lab_file import LAB_FILE, LabFile
from agvbench.running.configuration.provenance import (
    INPUTS_TABLE,
    RecordedInputs,
    Row,
    input_files,
    provenance,
    recorded_rows,
    recorded_trajectories,
    require_same_inputs,
    with_new,
)
from agvbench.running.configuration.settings import SETTINGS_FILE, BenchSettings, settings_for_resume
from agvbench.running.configuration.vehicles import LAB_VEHICLE, expected_calibration, known_models, with_lab_vehicle
from agvbench.running.execution.bench import Bench
from agvbench.running.execution.calibration import VEHICLE_FILE, calibrate_campaign
from agvbench.running.execution.campaign_time import (
    TURNAROUND_S,
    CampaignTime,
    SessionBegan,
    SimulatedCampaignTime,
    WallCampaignTime,
    idle_notice,
    last_end_s,
)
from agvbench.running.execution.runner_status import RunnerStatus
from agvbench.running.links import RunnerLink
from agvbench.running.positioning.placers import choose_placer
from agvbench.running.positioning.start_pose import notify_operator
from agvbench.running.session.end_pose_bias import read_bias_corrections
from agvbench.running.session.observers import listening_notice, observed_link, published_state
from agvbench.running.session.rig_checks import adapter_options, open_session_rig
from agvbench.running.session.session import BenchSession
from agvbench.running.session.termination_signals import interruptible
from agvbench.simulator import load_plant
from agvbench.types import Run

PROVENANCE_TABLE = "provenance"


@contextmanager
def open_session(
    given: Mapping[str, Any],
    *,
    out: str | None,
    resume: bool,
    dry_run: bool,
    plan: Sequence[Row] = (),
    on_progress: Callable[[str], None] = notify_operator,
    listen: str | None = None,
    is_observed: bool = False,
) -> Iterator[BenchSession]:
    """Open the session that the options `given` ask for, and close it whatever happens.

    ``plan`` lists the runs that it is to drive, as rows of the campaign's table ``planned``; `on_progress` prints it.
    Others may join the bus at the endpoint `listen`; the session's state is published where others can be on it.
    ``is_observed`` keeps every exchange for a reader of `BenchSession.state`.

    Raises
    ------
    AgvbenchError
        If an option, a file, the rig or the directory cannot be used.
    """
    given_directory, settings = session_settings(given, out, resume=resume)
    directory = given_directory.absolute()  # a benchmark may change the working directory
    models = known_models(settings)
    session_with = partial(
        BenchSession,
        directory,
        models=models,
        workspace=Workspace.parse(settings.workspace),
        bias_corrections=read_bias_corrections(settings.remainders),
        steering=settings.steering,
    )
    if dry_run:
        check_specs(settings.agv, settings.mocap, options := adapter_options(settings, models))
        load_plant(options.plant, options.plant_options)
        LabFile.of_folder()
        models.setdefault("calibrated", expected_calibration(settings.vehicle))
        yield session_with(bench=None)
        return
    recorded_inputs = recorded_rows(directory, INPUTS_TABLE) if resume else []
    trajectories = {str(row["trajectory"]) for row in plan if row["trajectory"]}
    inputs = input_files(settings, sorted(trajectories | recorded_trajectories(recorded_inputs)))
    require_same_inputs(recorded_inputs, inputs)
    if not resume:
        refuse_occupied(given_directory, "resume it, or choose another directory")
    with interruptible(), open_session_rig(settings, models, listen) as link:
        choose_placer(settings.place, simulated=link.identity().simulated)
        with locked(given_directory):
            header = _header(directory, settings, models["uncalibrated"], link, resume=resume)
            writer = _writer(directory, settings, header, resume=resume, simulated=link.identity().simulated)
            recorded_files = RecordedInputs(writer)
            recorded_files.add(inputs)
            _record_plan(writer, settings, plan)
            recorded = _recorded(writer)
            campaign_time = _campaign_time(link, writer, recorded, drives_back=settings.place == "auto")
            is_shared = bool(listen or settings.connect)
            status = RunnerStatus(writer.path.name)
            driven = observed_link(settings, link, status, is_observed=is_shared or is_observed)
            bench = _bench(settings, models, driven, writer, recorded, campaign_time, on_progress, status)
            session = session_with(bench=bench, inputs=recorded_files)
            session.notices = _notices(settings, given, given_directory)
            session.notices += listening_notice(settings, listen)
            session.notices += idle_notice(recorded.values(), campaign_time.now_s(), settings.session)
            try:
                published = published_state(bench, link if is_shared else None)
                with published, bench.pause.by_signal(), _without_left_out(writer, session):
                    yield session
            finally:
                bench.close()


def _notices(settings: BenchSettings, given: Mapping[str, Any], directory: Path) -> list[str]:
    """Return what was decided without being asked for."""
    is_found = settings.vehicle == LAB_VEHICLE and "vehicle" not in given
    is_copy = settings.calibration == str(directory / VEHICLE_FILE)
    is_lab_plant = "plant" not in given and settings.agv == "sim" and settings.plant == LabFile.of_folder().plant
    return (
        [f"vehicle: {LAB_VEHICLE} of this folder"] * is_found
        + [f"plant: {settings.plant}, from {LAB_FILE}"] * is_lab_plant
        + [f"calibration: the campaign's copy {settings.calibration}, since the file given before is gone"] * is_copy
    )


def _header(
    directory: Path, settings: BenchSettings, nominal: VehicleModel, link: VehicleLink, *, resume: bool
) -> CampaignHeader:
    """Return the campaign's header; a session that is resumed keeps the names and statements that it began with."""
    identity, lab = link.identity(), LabFile.of_folder()
    header = CampaignHeader(
        schema=schema_for(nominal.geometry.driven, nominal.geometry.kinematics, nominal.channels),
        name=directory.resolve().name,
        vehicle_name=nominal.name if settings.vehicle else identity.vehicle,
        front_axle_m=nominal.geometry.front_axle_m,
        rear_axle_m=nominal.geometry.rear_axle_m,
        channels=nominal.channels,
        mocap_rate_hz=identity.mocap_rate_hz,
        driven=nominal.geometry.driven,
        kinematics=nominal.geometry.kinematics,
        labels={**lab.labels, **labels_given(settings.label)},
        uncertainty=lab.uncertainty,
    )
    if resume and (directory / FILE_NAME).exists():
        stored = CampaignHeader.load(directory / FILE_NAME)
        kept = ("name", "vehicle_name", "labels", "uncertainty")
        return replace(header, **{name: getattr(stored, name) for name in kept})
    return header


def _writer(
    directory: Path, settings: BenchSettings, header: CampaignHeader, *, resume: bool, simulated: bool
) -> CampaignWriter:
    open_writer = CampaignWriter.resume if resume and (directory / FILE_NAME).exists() else CampaignWriter.create
    # What a power cut destroys of a simulation is simulated again; a laboratory's recording is lost.
    writer = open_writer(directory, header, durable=not simulated)
    if not (directory / SETTINGS_FILE).exists():
        settings.save(directory)
    if not (directory / f"{PROVENANCE_TABLE}.parquet").exists():
        facts = provenance(Path(__file__).parent, simulated=simulated)
        writer.write_table(PROVENANCE_TABLE, pd.DataFrame({"name": list(facts), "value": list(facts.values())}))
    return writer


def _record_plan(writer: CampaignWriter, settings: BenchSettings, plan: Sequence[Row]) -> None:
    """Keep what decides what is driven: the planned runs, the given calibration."""
    if rows := with_new(recorded_rows(writer.path, PLANNED_TABLE), plan, "run_id"):
        writer.write_table(PLANNED_TABLE, pd.DataFrame(rows))
    if settings.calibration and not (writer.path / VEHICLE_FILE).exists():
        given = Path(settings.calibration).read_bytes()
        writer.write_beside(VEHICLE_FILE, lambda path: path.write_bytes(given))


@contextmanager
def _without_left_out(writer: CampaignWriter, session: BenchSession) -> Iterator[None]:
    """Take runs that are not needed, or that this vehicle cannot drive here, out of the plan when the session ends."""
    try:
        yield
    finally:
        planned = recorded_rows(writer.path, PLANNED_TABLE)
        left_out = session.not_applicable | session.not_needed
        kept = [row for row in planned if row["run_id"] not in left_out]
        if len(kept) < len(planned):
            with suppress(RecordingError):  # what ended the session is the error to report
                writer.write_table(PLANNED_TABLE, pd.DataFrame(kept, columns=list(planned[0])))


def _bench(
    settings: BenchSettings,
    models: Mapping[str, VehicleModel],
    link: RunnerLink,
    writer: CampaignWriter,
    recorded: Mapping[str, Run],
    campaign_time: CampaignTime,
    on_progress: Callable[[str], None],
    status: RunnerStatus,
) -> Bench:
    def calibrated(awaited: Collection[str]) -> VehicleModel:
        priors = models["uncalibrated"].priors
        return models.get("calibrated") or calibrate_campaign(
            writer, maps=settings.maps, awaited=awaited, priors=priors
        )

    return Bench(
        settings,
        nominal=models["uncalibrated"],
        corrected=models.get("corrected"),
        link=link,
        writer=writer,
        campaign_time=campaign_time,
        session=SessionBegan.of(settings.session, recorded.values()),
        calibrate=calibrated,
        recorded=recorded,
        on_progress=on_progress,
        status=status,
    )


def _recorded(writer: CampaignWriter) -> dict[str, Run]:
    if not writer.finished_ids:
        return {}
    campaign = Campaign.open(writer.path)
    return {run_id: campaign.run(run_id) for run_id in writer.finished_ids}


def _campaign_time(
    link: VehicleLink, writer: CampaignWriter, recorded: Mapping[str, Run], *, drives_back: bool
) -> CampaignTime:
    if link.identity().simulated:
        return SimulatedCampaignTime(0.0 if drives_back else TURNAROUND_S)
    table = pd.read_parquet(os.fspath(writer.path / f"{PROVENANCE_TABLE}.parquet"))
    began = dict(zip(table["name"], table["value"], strict=True))["began"]
    return WallCampaignTime(datetime.fromisoformat(began).timestamp(), last_end_s(recorded.values()))


def session_settings(given: Mapping[str, Any], out: str | None, *, resume: bool) -> tuple[Path, BenchSettings]:
    """Return where a session writes, and its settings: what was `given`, over what it began with if it is resumed.

    Raises
    ------
    FlagError
        If an option cannot be used or contradicts what the session began with, or there is none to resume.
    FileError
        If what it began with cannot be read.
    CampaignError
        If a campaign that is to be resumed lacks its header, or its runs lack the settings of their session.
    """
    directory = choose_directory(out, resume=resume)
    if resume and (directory / SETTINGS_FILE).exists():
        settings = settings_for_resume(BenchSettings.load(directory), given)
        _require(directory, FILE_NAME, "the header of the campaign")
        return directory, _with_own_calibration(directory, settings)
    if resume and has_runs(directory):  # a session that ended between header and settings has no runs
        _require(directory, SETTINGS_FILE, "the settings of its session")
    return directory, BenchSettings.given(with_lab_vehicle(given))


def _require(directory: Path, name: str, what: str) -> None:
    if not (directory / name).exists():
        raise CampaignError(
            f"cannot be resumed without {name} ({what})", where=directory,
            remedy="restore it from a copy, or begin a new campaign in another directory",
        )  # fmt: skip


def _with_own_calibration(directory: Path, settings: BenchSettings) -> BenchSettings:
    """Return `settings` with the campaign's copy of the calibration where the file that was given is gone."""
    copy = directory / VEHICLE_FILE
    if not settings.calibration or Path(settings.calibration).exists() or not copy.is_file():
        return settings
    is_hashed = any(row["input"] == "--calibration" for row in recorded_rows(directory, INPUTS_TABLE))
    return replace(settings, calibration=str(copy)) if is_hashed else settings
