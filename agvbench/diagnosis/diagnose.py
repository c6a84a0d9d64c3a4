"""From a campaign to a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import RunMeasurement, measure_run
from agvbench.calibration.source import CampaignLike, HeaderLike
from agvbench.diagnosis.candidates import bounds_of, candidates, given_effects
from agvbench.diagnosis.contradictions import refuse_contradictions
from agvbench.diagnosis.empirical import Explained, described, explain, term_candidates, with_term_first
from agvbench.diagnosis.estimates import named_effects
from agvbench.diagnosis.forms import BEYOND, form_candidates, reform_and_resettle, tried_beside
from agvbench.diagnosis.grouping import held_out_runs
from agvbench.diagnosis.levels import ROLES, FreeMaps, free_maps, start_values
from agvbench.diagnosis.map_effects import map_effects
from agvbench.diagnosis.next_experiment_propose import with_next_experiment
from agvbench.diagnosis.plausibility import refuse_clocks, refuse_units
from agvbench.diagnosis.prediction import Batch, Predictor
from agvbench.diagnosis.provenance import provenance, refuse_nothing
from agvbench.diagnosis.reading import Readings, read_runs
from agvbench.diagnosis.residual_spread import EndSpread, end_spread
from agvbench.diagnosis.residual_table import with_residuals
from agvbench.diagnosis.residuals import AT_THE_FLOOR, LACK_OF_FIT, Misses, floor, lack_of_fit, misses
from agvbench.diagnosis.result import Diagnosis, HeldOut, Verdict
from agvbench.diagnosis.selection import Selection, Selector
from agvbench.diagnosis.standing import resettle, settle
from agvbench.diagnosis.structure import RANDOM_PHASE, Dependence, dependences, residual_rates, swing
from agvbench.diagnosis.thinning import MOST_RUNS, measured_in_all, some_repeats
from agvbench.diagnosis.vehicle import corrected_vehicle
from agvbench.diagnosis.veto import withdrawn
from agvbench.diagnosis.windows import horizon_of
from agvbench.diagnosis.windows_diagnose import diagnose_windows
from agvbench.effects.forms import effect_forms
from agvbench.errors import CampaignError, FitError
from agvbench.model import VehicleModel, nominal_model
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Geometry

FEWEST_RUNS = 20
FEWEST_REPEATED = 3
_LEAST_TURN_RAD = 0.05


@dataclass(frozen=True)
class _Judged:
    before: Misses
    after: Misses
    floor: dict[str, float]
    lack_of_fit: float | None


def diagnose(
    campaign: CampaignLike,
    *,
    vehicle: VehicleModel | None = None,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
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
        Draws which groups of runs are set aside, where the campaign has no column ``split``.
    tell
        Called with a line whenever there is progress.

    Raises
    ------
    CampaignError, FitError
        If the campaign is too small, or its tables contradict themselves.
    """
    header = campaign.header
    runs = list(campaign)
    refuse_units(runs, header)
    if (horizon := horizon_of(header, runs)) is not None:
        return diagnose_windows(header, runs, horizon, vehicle=vehicle, seed=seed, tell=tell)
    geometry = Geometry(header.front_axle_m, header.rear_axle_m)
    readings = read_runs(runs, header.neutral)
    if reason := _cannot_tell(readings, header):
        return Diagnosis(Verdict.NOT_IDENTIFIABLE, reason, provenance=_provenance(header, readings, seed))
    refuse_contradictions(readings, where=f"campaign {header.name}")
    held = held_out_runs(readings.runs, readings.group, seed)
    if not held.any():
        return Diagnosis(
            Verdict.NOT_IDENTIFIABLE,
            "no run can be set aside to judge on: drive repeats, or commands in more combinations",
            provenance=_provenance(header, readings, seed),
        )
    fitted, kept = readings.select(~held), readings.select(held)
    tell(f"{len(fitted)} runs to fit, {len(kept)} held out")
    some = fitted.select(some_repeats(fitted.group, MOST_RUNS))
    measured = _measured(some.runs, geometry, header.neutral)
    maps = free_maps(some.runs, header.neutral)
    start = start_values(maps, measured, _believed(maps, header, geometry, vehicle))
    tried, kinds = tried_beside(vehicle)
    names, values = given_effects(vehicle, tried)
    selector = settle(Selector(Batch(some, maps, geometry, kinds=kinds), tried, start, seed, tell, names, values))
    chosen, selector = resettle(selector.select(), selector)
    selection, selector = reform_and_resettle(chosen, selector)
    readings = replace(readings, stood=selector.batch.readings.stood)
    explained = explain(selection, selector)
    if len(some) < len(fitted):
        tell(f"causes were looked for in {len(some)} runs; now they are measured in all {len(fitted)}")
        selection, explained = measured_in_all(selection, explained, selector, fitted)
    selection, explained = withdrawn(selection, explained, readings.select(held), tell)
    return _conclude(header, readings, held, selection, explained, vehicle, geometry, seed)


def _cannot_tell(readings: Readings, header: HeaderLike) -> str:
    """Return why this campaign cannot be diagnosed, or nothing."""
    refuse_clocks(readings.refused, len(readings) + len(readings.refused), where=f"campaign {header.name}")
    refuse_nothing(readings, header)
    if len(readings) < FEWEST_RUNS:
        raise CampaignError(
            "too few runs to diagnose",
            where=f"campaign {header.name}",
            value=len(readings),
            limit=f"at least {FEWEST_RUNS} that begin at rest",
            remedy="drive bench_calibration.py and bench_trajectories.py first",
        )
    commands = [run.commands for run in readings.runs]
    if all(np.all(c.drive == header.neutral) for c in commands):
        return "the drive was never told anything but neutral"
    if len({(f, r) for c in commands for f, r in zip(c.front.tolist(), c.rear.tolist(), strict=True)}) == 1:
        return "steering was never excited: its commands are the same in all runs"
    _, sizes = np.unique(readings.group, return_counts=True)
    if np.count_nonzero(sizes >= 2) < FEWEST_REPEATED:
        return f"without repeats there is no floor: at least {FEWEST_REPEATED} commands must be driven twice or more"
    moved = np.nanmax(np.hypot(*np.moveaxis(readings.poses[..., :2] - readings.start[:, None, :2], -1, 0)), axis=1)
    if np.count_nonzero(moved > 0.1) < FEWEST_RUNS // 2:
        return f"the vehicle hardly moved: {np.count_nonzero(moved > 0.1)} runs went farther than 0.1 m"
    turned = np.nanmax(np.abs(readings.poses[..., 2] - readings.start[:, None, 2]), axis=1)
    if np.count_nonzero(turned > _LEAST_TURN_RAD) < FEWEST_REPEATED:
        return "steering was never excited: hardly a run turns"
    return ""


def _measured(runs: tuple[Run, ...], geometry: Geometry, neutral: float) -> list[RunMeasurement]:
    out = []
    for run in runs:
        try:
            out.append(measure_run(run, geometry, neutral=neutral))
        except FitError:
            continue  # a run without a steady part is no start value, but evidence all the same
    return out


def _believed(
    maps: FreeMaps, header: HeaderLike, geometry: Geometry, vehicle: VehicleModel | None
) -> dict[str, Floats]:
    model = vehicle or nominal_model(header.vehicle_name, geometry, header.command_unit, header.neutral)
    return {role: np.asarray(getattr(model, role)(maps.nodes[role])) for role in ROLES}


def _conclude(
    header: HeaderLike,
    readings: Readings,
    held: NDArray[np.bool_],
    library: Selection,
    explained: Explained | None,
    vehicle: VehicleModel | None,
    geometry: Geometry,
    seed: int,
) -> Diagnosis:
    selection = explained.selection if explained else library
    fit = selection.chosen.fit
    maps = fit.predictor.maps
    reformed = bool(effect_forms().keys() & set(selection.chosen.names))
    kinds = BEYOND if explained or reformed else ()
    every = Predictor(Batch(readings, maps, geometry, kinds=kinds), selection.chosen.names)
    poses = every.predict(fit.parameters)
    static = Predictor(every.batch, selection.base.names).predict(selection.base.fit.parameters)
    before = static if vehicle is None else _believed_poses(vehicle, readings)
    judged = _judge(readings, held, before, poses, end_spread(every, fit))
    if judged is None:
        why = "there are no repeats among the runs held out or fitted, and so no floor"
        return Diagnosis(Verdict.NOT_IDENTIFIABLE, why, provenance=_provenance(header, readings, seed))
    rest = _what_is_left(every.batch, poses, explained, seed)
    known = candidates() | term_candidates() | form_candidates()
    effects = named_effects(selection, bounds_of(known, selection.chosen.names)) + map_effects(fit, vehicle)
    significant = explained is not None or _is_significant(judged, rest)
    verdict, why = _verdict(effects, significant, rest, explained)
    model = corrected_vehicle(header, geometry, fit, maps, seed)
    found = Diagnosis(
        verdict,
        why,
        effects,
        significant,
        tuple(rest),
        _held_out(readings.select(held), judged),
        model,
        selection.rejected,
        _provenance(header, readings, seed)
        | _how_it_was_fitted(selection, readings, held)
        | {"lack_of_fit_p_value": judged.lack_of_fit}
        | ({"empirical_term": described(explained)} if explained else {}),
    )
    found = with_residuals(found, readings, held, before, poses)
    return found if explained or reformed else with_next_experiment(found, selection, readings, header, seed)


def _what_is_left(batch: Batch, poses: Floats, explained: Explained | None, seed: int) -> list[Dependence]:
    """Return what the rest depends on: that of the model without an empirical term, whose own covariate comes first."""
    readings, unexplained = batch.readings, poses
    if explained is not None:
        without = explained.without
        unexplained = Predictor(batch, without.names).predict(without.fit.parameters)
    rest = dependences(residual_rates(readings, unexplained), readings.group, seed)
    # A place passed through in every run can look like a swing: it is looked for in what the term leaves.
    if (swings := swing(residual_rates(readings, poses), seed)) is not None:
        rest = [swings, *(d for d in rest if d.covariate != RANDOM_PHASE)]
    return rest if explained is None else with_term_first(rest, explained)


def _how_it_was_fitted(selection: Selection, readings: Readings, held: NDArray[np.bool_]) -> dict[str, object]:
    offsets = selection.chosen.fit.scatter.offsets
    return {
        "fit_runs": int((~held).sum()),
        "searched_runs": int(some_repeats(readings.group[~held], MOST_RUNS).sum()),
        "models_fitted": selection.tried,
        "steering_stood_at": "the first command" if readings.stood else "neutral",
        "scatter": {
            "front_deg": float(np.degrees(offsets[1])),
            "rear_deg": float(np.degrees(offsets[2])),
            "speed_percent": 100.0 * float(offsets[3]),
        },
    }


def _believed_poses(vehicle: VehicleModel, readings: Readings) -> Floats:
    poses = vehicle.rollout([run.commands for run in readings.runs], readings.start, list(readings.t_s))
    return np.array(poses)


def _judge(
    readings: Readings, held: NDArray[np.bool_], before: Floats, after: Floats, spread: EndSpread
) -> _Judged | None:
    kept = readings.select(held)
    missed = misses(kept, after[held])
    least = floor(missed, kept.group) or floor(misses(readings, after), readings.group)
    if least is None:
        return None
    return _Judged(misses(kept, before[held]), missed, least, lack_of_fit(missed, kept.group, spread.select(held)))


def _is_significant(judged: _Judged, rest: list[Dependence]) -> bool:
    after = judged.after.rms()
    above = any(after[name] > AT_THE_FLOOR * judged.floor[name] for name in ("position_rms_mm", "heading_rms_deg"))
    lacks = judged.lack_of_fit is not None and judged.lack_of_fit < LACK_OF_FIT
    return (above and lacks) or bool(rest)


def _verdict(
    effects: tuple[object, ...], significant: bool, rest: list[Dependence], explained: Explained | None
) -> tuple[Verdict, str]:
    if significant:
        on = f" it depends on {rest[0].covariate}" if rest else " but on none of the covariates looked at"
        if explained is not None:
            on += f", and {explained.term.name} describes it"
        elif rest and rest[0].covariate == RANDOM_PHASE:
            on += ", with another phase in every run, which nothing that is planned beforehand can remove"
        return Verdict.UNKNOWN, "structure remains that no effect explains:" + on
    if not effects:
        return Verdict.ADEQUATE, "the model, its maps fitted again, predicts as well as repeats agree with one another"
    if any(getattr(effect, "confounded_with", ()) for effect in effects):
        return Verdict.AMBIGUOUS, "several effects explain the residual equally well"
    return Verdict.NAMED, "the effects named bring the prediction to the floor"


def _held_out(kept: Readings, judged: _Judged) -> HeldOut:
    before, after = judged.before.rms(), judged.after.rms()
    errors = {name: {"before": before[name], "after": after[name], "floor": judged.floor[name]} for name in before}
    was, now = judged.before.squares()["position_rms_mm"], judged.after.squares()["position_rms_mm"]
    slack = (judged.floor["position_rms_mm"] / 1e3) ** 2
    worse = []
    for g in np.unique(kept.group):
        own = kept.group == g
        if float(np.mean(now[own])) > float(np.mean(was[own])) + slack:
            run = kept.runs[int(np.argmax(own))]
            worse.append(run.trajectory or run.run_id)
    return HeldOut(len(kept), errors, tuple(dict.fromkeys(worse)))


def _provenance(header: HeaderLike, readings: Readings, seed: int) -> dict[str, object]:
    return provenance(header, readings, seed, runs_used=len(readings))
