"""The diagnosis of runs from rest: load, check, split, select, validate, conclude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.calibration import RunMeasurement, measure_run
from agvbench.calibration.campaign_protocol import CampaignLike
from agvbench.diagnosis.checks.consistency import require_consistent_repeats, require_plausible_units
from agvbench.diagnosis.checks.sufficiency import insufficient_data
from agvbench.diagnosis.conclusion import conclude
from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.readings import Readings, read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.diagnosis.data.windows import horizon_of
from agvbench.diagnosis.discrepancy.stepwise import add_term_and_reconsider, term_in_place
from agvbench.diagnosis.free_driving.diagnose import diagnose_windows
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps, nodal_maps, start_values
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.diagnosis.selection.fitted_models import OnProgress
from agvbench.diagnosis.selection.initial_steering import choose_initial_steering, reconsider_initial_steering
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.subsampling import refit_to_all, subsample_repeats
from agvbench.diagnosis.selection.validation import fails_validation, validated
from agvbench.diagnosis.selection.variants import candidates_for, select_variants_and_reconsider
from agvbench.diagnosis.selection.with_term import TermSelection
from agvbench.errors import FitError
from agvbench.model import VehicleModel, nominal_model
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Geometry


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
    header = campaign.header
    runs = list(campaign)
    context = DiagnosisContext(header, Geometry(header.front_axle_m, header.rear_axle_m), vehicle, seed)
    require_plausible_units(runs, header)
    if (horizon := horizon_of(header, runs)) is not None:
        return diagnose_windows(context, runs, horizon, on_progress)
    readings = read_runs(runs, header.neutral)
    if reason := insufficient_data(readings, header):
        return context.not_identifiable(readings, reason)
    require_consistent_repeats(readings, where=f"campaign {header.name}")
    split = split_runs(readings.runs, readings.group, seed)
    if not split.test.any():
        why = "no run can be spared for the test: drive repeats, or commands in more combinations"
        return context.not_identifiable(readings, why)
    fitted = readings.select(split.training)
    on_progress(f"{len(fitted)} training runs, {split.validation.sum()} validation runs, {split.test.sum()} test runs")
    selector = _selector(context, fitted.select(subsample_repeats(fitted.group, DATA.max_selection_runs)), on_progress)
    chosen, selector = reconsider_initial_steering(selector.select(), selector)
    selection, selector = select_variants_and_reconsider(chosen, selector)
    selection, term_selection, selector = add_term_and_reconsider(selection, selector)
    readings = replace(readings, preset=selector.batch.readings.preset)
    opened, validation = readings.select(~split.test), readings.select(split.validation)
    if (searched := len(selector.batch.readings)) < len(fitted):
        on_progress(f"effects were selected in {searched} runs; they are refitted to all {len(fitted)}")
    found = _refitted_and_validated(selection, term_selection, selector, fitted, validation)
    if found[1] is None and found[0].gains and fails_validation(found[0], opened, split.validation[~split.test]):
        on_progress("the validation runs contradict the selection: a discrepancy term is tried in its place")
        if (term := term_in_place(selection, selector)) is not None:
            with_term = _refitted_and_validated(selection, term, selector, fitted, validation)
            found = found if with_term[1] is None else with_term
    return conclude(context, readings, split, *found, searched)


def _refitted_and_validated(
    selection: Selection,
    term_selection: TermSelection | None,
    selector: Selector,
    fitted: Readings,
    validation: Readings,
) -> tuple[Selection, TermSelection | None]:
    """Return the selection refitted to all training runs `fitted`, or the maps alone if validation rejects it."""
    if len(selector.batch.readings) < len(fitted):
        selection, term_selection = refit_to_all(selection, term_selection, selector, fitted)
    return validated(selection, term_selection, validation, selector.on_progress)


def _selector(context: DiagnosisContext, readings: Readings, on_progress: OnProgress) -> Selector:
    """Return the selector for these runs, with the better of both initial states of the steering."""
    header = context.header
    maps = nodal_maps(readings.runs, header.neutral)
    start = start_values(
        maps, _measurements(readings.runs, context.geometry, header.neutral), _prior_values(maps, context)
    )
    tried, kinds = candidates_for(context.vehicle)
    batch = Batch(readings, maps, context.geometry, kinds=kinds)
    return choose_initial_steering(
        Selector(batch, tried, start, context.seed, on_progress, *given_effects(context.vehicle, tried))
    )


def _measurements(runs: tuple[Run, ...], geometry: Geometry, neutral: float) -> list[RunMeasurement]:
    out = []
    for run in runs:
        try:
            out.append(measure_run(run, geometry, neutral=neutral))
        except FitError:
            continue  # a run without a steady part gives no initial value, but remains in the fit
    return out


def _prior_values(maps: NodalMaps, context: DiagnosisContext) -> dict[str, Floats]:
    """Return the values of the vehicle model before (or the nominal one) at the nodes of the maps, by role."""
    header = context.header
    model = context.vehicle or nominal_model(header.vehicle_name, context.geometry, header.command_unit, header.neutral)
    return {role: np.asarray(getattr(model, role)(maps.nodes[role])) for role in ROLES}
