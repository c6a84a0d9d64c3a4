"""From a campaign to a verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.calibration import RunMeasurement, measure_run
from agvbench.calibration.campaign_protocol import CampaignLike
from agvbench.diagnosis.checks.consistency import refuse_contradictions, refuse_units
from agvbench.diagnosis.checks.sufficiency import cannot_tell
from agvbench.diagnosis.conclusion import conclude
from agvbench.diagnosis.context import Asked
from agvbench.diagnosis.data.readings import Readings, read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.diagnosis.data.windows import horizon_of
from agvbench.diagnosis.discrepancy.stepwise import explain_and_resettle, instead
from agvbench.diagnosis.free_driving.diagnose import diagnose_windows
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, FreeMaps, free_maps, start_values
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.diagnosis.selection.fitted_models import Tell
from agvbench.diagnosis.selection.initial_steering import resettle, settle
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.subsampling import MOST_RUNS, measured_in_all, some_repeats
from agvbench.diagnosis.selection.validation import contradicts, withdrawn
from agvbench.diagnosis.selection.variants import reform_and_resettle, tried_beside
from agvbench.diagnosis.selection.with_term import Explained
from agvbench.errors import FitError
from agvbench.model import VehicleModel, nominal_model
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Geometry


def diagnose(
    campaign: CampaignLike,
    *,
    vehicle: VehicleModel | None = None,
    seed: int = 0,
    tell: Tell = lambda _: None,
) -> Diagnosis:
    """Say whether static maps describe the vehicle that drove `campaign`, and if not which effects they lack.

    Parameters
    ----------
    campaign
        Header and runs. Where the header has a prediction horizon, or runs do not begin at rest, they are cut into
        windows.
    vehicle
        The model before; effects that it has stay, and are not named again. By default static maps fitted to the
        campaign's own runs.
    seed
        Draws which runs are for training, validation and test, where the campaign has no column ``split``.
    tell
        Called with a line whenever there is progress.

    Raises
    ------
    CampaignError, FitError
        If the campaign is too small, or its tables contradict themselves.
    """
    header = campaign.header
    runs = list(campaign)
    asked = Asked(header, Geometry(header.front_axle_m, header.rear_axle_m), vehicle, seed)
    refuse_units(runs, header)
    if (horizon := horizon_of(header, runs)) is not None:
        return diagnose_windows(asked, runs, horizon, tell)
    readings = read_runs(runs, header.neutral)
    if reason := cannot_tell(readings, header):
        return asked.cannot_tell(readings, reason)
    refuse_contradictions(readings, where=f"campaign {header.name}")
    split = split_runs(readings.runs, readings.group, seed)
    if not split.test.any():
        why = "no run can be spared for the test: drive repeats, or commands in more combinations"
        return asked.cannot_tell(readings, why)
    fitted = readings.select(split.training)
    tell(f"{len(fitted)} training runs, {split.validation.sum()} validation runs, {split.test.sum()} test runs")
    selector = _selector(asked, fitted.select(some_repeats(fitted.group, MOST_RUNS)), tell)
    chosen, selector = resettle(selector.select(), selector)
    selection, selector = reform_and_resettle(chosen, selector)
    selection, explained, selector = explain_and_resettle(selection, selector)
    readings = replace(readings, stood=selector.batch.readings.stood)
    known, validation = readings.select(~split.test), readings.select(split.validation)
    if (searched := len(selector.batch.readings)) < len(fitted):
        tell(f"causes were looked for in {searched} runs; now they are measured in all {len(fitted)}")
    found = _measured_and_kept(selection, explained, selector, fitted, validation)
    if found[1] is None and found[0].gains and contradicts(found[0], known, split.validation[~split.test]):
        tell("the validation runs contradict what was found: a term is tried in its place")
        if (other := instead(selection, selector)) is not None:
            again = _measured_and_kept(selection, other, selector, fitted, validation)
            found = found if again[1] is None else again
    return conclude(asked, readings, split, *found, searched)


def _measured_and_kept(
    selection: Selection, explained: Explained | None, selector: Selector, fitted: Readings, validation: Readings
) -> tuple[Selection, Explained | None]:
    """Return what was found measured in all runs `fitted`, or the maps alone where the validation runs say so."""
    if len(selector.batch.readings) < len(fitted):
        selection, explained = measured_in_all(selection, explained, selector, fitted)
    return withdrawn(selection, explained, validation, selector.tell)


def _selector(asked: Asked, some: Readings, tell: Tell) -> Selector:
    """Return what tries effects on these runs, where steering stood before them settled."""
    header = asked.header
    maps = free_maps(some.runs, header.neutral)
    start = start_values(maps, _measured(some.runs, asked.geometry, header.neutral), _believed(maps, asked))
    tried, kinds = tried_beside(asked.vehicle)
    batch = Batch(some, maps, asked.geometry, kinds=kinds)
    return settle(Selector(batch, tried, start, asked.seed, tell, *given_effects(asked.vehicle, tried)))


def _measured(runs: tuple[Run, ...], geometry: Geometry, neutral: float) -> list[RunMeasurement]:
    out = []
    for run in runs:
        try:
            out.append(measure_run(run, geometry, neutral=neutral))
        except FitError:
            continue  # a run without a steady part is no start value, but evidence all the same
    return out


def _believed(maps: FreeMaps, asked: Asked) -> dict[str, Floats]:
    """Return what the model before says at the maps' nodes, by role."""
    header = asked.header
    model = asked.vehicle or nominal_model(header.vehicle_name, asked.geometry, header.command_unit, header.neutral)
    return {role: np.asarray(getattr(model, role)(maps.nodes[role])) for role in ROLES}
