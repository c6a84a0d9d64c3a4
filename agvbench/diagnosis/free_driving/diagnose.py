"""The diagnosis of free driving: windows in place of runs from rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.context import DiagnosisContext, require_runs
from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.readings import Readings, read_windows
from agvbench.diagnosis.data.window_splits import held_out_windows, thinned
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.free_driving.conclusion import WindowConclusion
from agvbench.diagnosis.free_driving.maps import NODES, smooth_maps, start_values_of_windows
from agvbench.diagnosis.free_driving.predictors import autocorrelation_time, nodal_deviation
from agvbench.diagnosis.free_driving.selection import WindowSelector
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.diagnosis.selection.fitted_models import OnProgress
from agvbench.diagnosis.selection.variants import candidates_for
from agvbench.errors import CampaignError
from agvbench.types import Run
from agvbench.vehicle.geometry import Geometry


def diagnose_windows(
    context: DiagnosisContext, runs: Sequence[Run], horizon: Horizon, on_progress: OnProgress
) -> Diagnosis:
    """Diagnose free driving; see `agvbench.diagnosis.diagnose`.

    Errors are those at the horizon. Differences of the drive level between sessions are estimated from the initial
    speed of each window, if there are several sessions.
    """
    readings = read_windows(runs, horizon, context.header.neutral)
    if reason := _insufficient_data(readings, context.header, horizon):
        return context.not_identifiable(readings, reason)
    held = held_out_windows(readings, context.seed)
    if not held.any():
        return context.not_identifiable(readings, "no stretch of driving can be spared for the test: drive for longer")
    fitted = readings.select(thinned(np.flatnonzero(~held), DATA.max_fitted_windows))
    on_progress(f"{len(fitted)} training windows, {np.count_nonzero(held)} test windows")
    static = _static(fitted, context.geometry, context.header.neutral)
    selector = _selector(context, readings, held, static, on_progress)
    selection = selector.select()
    on_progress("computing the errors of the test windows")
    assessment = readings.select(
        np.sort(np.r_[np.flatnonzero(held), thinned(np.flatnonzero(~held), DATA.max_assessed_windows)])
    )
    held = np.isin([r.run_id for r in assessment.runs], [r.run_id for r in readings.select(held).runs])
    return WindowConclusion(context, readings, assessment, held, static, selector, selection).diagnosis(horizon)


def _selector(
    context: DiagnosisContext, readings: Readings, held: NDArray[np.bool_], static: Fit, on_progress: OnProgress
) -> WindowSelector:
    """Return the selector for the training windows of `static`; the windows `held` are for test."""
    fitted, maps = static.predictor.readings, static.predictor.maps
    test = readings.select(thinned(np.flatnonzero(held), DATA.max_fitted_windows))
    tried, kinds = candidates_for(context.vehicle)
    names, values = given_effects(context.vehicle, tried)
    has_sessions = len(np.unique(readings.initial_states.session)) > 1 if readings.initial_states else False
    variance_components = nodal_deviation(static.predictor, static.parameters) if has_sessions else np.inf
    fitted_maps = fit(
        Predictor(Batch(fitted, maps, context.geometry, variance_components)), static.parameters, np.empty((0, 2))
    )
    batch = Batch(fitted, maps, context.geometry, variance_components, autocorrelation_time(fitted_maps), kinds)
    test_batch = Batch(test, maps, context.geometry, variance_components, kinds=kinds)
    return WindowSelector(
        batch, tried, fitted_maps.parameters, context.seed, on_progress, names, values, test_batch=test_batch
    )


def _insufficient_data(readings: Readings, header: HeaderLike, horizon: Horizon) -> str:
    require_runs(readings, header)
    if len(readings) < DATA.min_windows:
        raise CampaignError(
            "too little free driving to diagnose",
            where=f"campaign {header.name}",
            value=f"{len(readings)} windows of {horizon.horizon_s:g} s",
            limit=f"at least {DATA.min_windows}",
            remedy="drive for longer, or predict less far ahead (campaign.toml, [prediction] horizon_s)",
        )
    if len(np.unique(readings.group)) < DATA.min_blocks:
        stretches = len(np.unique(readings.group))
        return f"{stretches} stretches of {horizon.block_s:g} s are too few for a test: drive for longer"
    turned = np.nanmax(np.abs(readings.poses[..., 2] - readings.start[:, None, 2]), axis=1)
    if np.count_nonzero(turned > DATA.min_turn_rad) < DATA.min_blocks:
        return "steering was never excited: hardly a window turns"
    return ""


def _static(fitted: Readings, geometry: Geometry, neutral: float) -> Fit:
    """Return the static maps fitted to the windows, with the number of nodes by Schwarz's criterion."""
    best: tuple[float, Fit] | None = None
    for steering, drive in NODES:
        maps = smooth_maps(fitted.runs, neutral, steering, drive)
        start = start_values_of_windows(maps, fitted, geometry)
        found = fit(Predictor(Batch(fitted, maps, geometry)), start, np.empty((0, 2)))
        total = float(found.loss.sum()) + maps.size * float(np.log(len(fitted)))
        if best is not None and total > best[0]:
            break
        best = total, found
    assert best is not None, "there is a first choice of nodes"  # noqa: S101
    return best[1]
