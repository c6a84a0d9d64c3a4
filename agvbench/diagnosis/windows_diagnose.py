"""From free driving to a verdict: windows in place of runs from rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration.source import HeaderLike
from agvbench.diagnosis.candidates import bounds_of, given_effects
from agvbench.diagnosis.estimates import named_effects
from agvbench.diagnosis.fitted_models import Scored
from agvbench.diagnosis.fitting import Fit, fit
from agvbench.diagnosis.forms import tried_beside
from agvbench.diagnosis.prediction import Batch, Predictor
from agvbench.diagnosis.provenance import provenance, refuse_nothing
from agvbench.diagnosis.reading import Readings, read_windows
from agvbench.diagnosis.result import Diagnosis, HeldOut, NamedEffect, Verdict
from agvbench.diagnosis.selection import Selection
from agvbench.diagnosis.structure import Dependence, dependences, residual_rates
from agvbench.diagnosis.vehicle import corrected_vehicle
from agvbench.diagnosis.windows import SUPPORT_S, Horizon
from agvbench.diagnosis.windows_errors import QUANTITIES, by_recording, floor_squares, rms, squares
from agvbench.diagnosis.windows_maps import NODES, smooth_maps, start_values_of_windows
from agvbench.diagnosis.windows_predictors import believed, by_speed_error, level_scatter, naive, redundancy, speed_held
from agvbench.diagnosis.windows_selection import WindowSelector
from agvbench.diagnosis.windows_split import MOST_FITTED, MOST_JUDGED, held_out_windows, thinned
from agvbench.errors import CampaignError
from agvbench.model import VehicleModel
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Geometry

FEWEST_WINDOWS = 20
FEWEST_STRETCHES = 5
AT_THE_FLOOR = 1.25
FAR_ABOVE = 5.0
"""The floor of windows is a lower bound, for the vehicle's own scatter cannot be seen without repeats: so many times it
is more than scatter."""

_LEAST_TURN_RAD = 0.05


def diagnose_windows(
    header: HeaderLike,
    runs: Sequence[Run],
    horizon: Horizon,
    *,
    vehicle: VehicleModel | None,
    seed: int,
    tell: Callable[[str], None],
) -> Diagnosis:
    """Diagnose free driving; see `agvbench.diagnosis.diagnose`.

    Errors are those at the horizon. What differs from session to session in the drive's level is read off the speed at
    the beginning of a window, where there are several sessions.
    """
    geometry = Geometry(header.front_axle_m, header.rear_axle_m)
    readings = read_windows(runs, horizon, header.neutral)
    if reason := _cannot_tell(readings, header, horizon):
        return Diagnosis(Verdict.NOT_IDENTIFIABLE, reason, provenance=_provenance(header, readings, seed))
    held = held_out_windows(readings, seed)
    if not held.any():
        return Diagnosis(
            Verdict.NOT_IDENTIFIABLE,
            "no stretch of driving can be set aside to judge on: drive for longer",
            provenance=_provenance(header, readings, seed),
        )
    fitted = readings.select(thinned(np.flatnonzero(~held), MOST_FITTED))
    tell(f"{len(fitted)} windows to fit, {np.count_nonzero(held)} held out")
    static = _static(fitted, geometry, header.neutral)
    tried, kinds = tried_beside(vehicle)
    names, values = given_effects(vehicle, tried)
    several = len(np.unique(readings.begins.session)) > 1 if readings.begins else False
    scatter = level_scatter(static.predictor, static.parameters) if several else np.inf
    level = fit(Predictor(Batch(fitted, static.predictor.maps, geometry, scatter)), static.parameters, np.empty((0, 2)))
    alike = redundancy(level)
    batch = Batch(fitted, static.predictor.maps, geometry, scatter, alike, kinds)
    aside = readings.select(thinned(np.flatnonzero(held), MOST_FITTED))
    elsewhere = Batch(aside, static.predictor.maps, geometry, scatter, kinds=kinds)
    selector = WindowSelector(batch, tried, level.parameters, seed, tell, names, values, elsewhere=elsewhere)
    selection = selector.select()
    tell("judging on what was held out")
    judged = readings.select(np.sort(np.r_[np.flatnonzero(held), thinned(np.flatnonzero(~held), MOST_JUDGED)]))
    held = np.isin([r.run_id for r in judged.runs], [r.run_id for r in readings.select(held).runs])
    return _Conclusion(header, geometry, readings, judged, held, static, selector, selection, vehicle, seed).diagnosis(
        horizon
    )


def _cannot_tell(readings: Readings, header: HeaderLike, horizon: Horizon) -> str:
    refuse_nothing(readings, header)
    if len(readings) < FEWEST_WINDOWS:
        raise CampaignError(
            "too little free driving to diagnose",
            where=f"campaign {header.name}",
            value=f"{len(readings)} windows of {horizon.horizon_s:g} s",
            limit=f"at least {FEWEST_WINDOWS}",
            remedy="drive for longer, or predict less far ahead (campaign.toml, [prediction] horizon_s)",
        )
    if len(np.unique(readings.group)) < FEWEST_STRETCHES:
        stretches = len(np.unique(readings.group))
        return f"{stretches} stretches of {horizon.block_s:g} s are too few to set some aside: drive for longer"
    turned = np.nanmax(np.abs(readings.poses[..., 2] - readings.start[:, None, 2]), axis=1)
    if np.count_nonzero(turned > _LEAST_TURN_RAD) < FEWEST_STRETCHES:
        return "steering was never excited: hardly a window turns"
    return ""


def _static(fitted: Readings, geometry: Geometry, neutral: float) -> Fit:
    """Return the static maps fitted to the windows, as fine as their errors ask for (by Schwarz's criterion)."""
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


@dataclasses.dataclass
class _Conclusion:
    header: HeaderLike
    geometry: Geometry
    readings: Readings
    judged: Readings
    held: NDArray[np.bool_]
    static: Fit
    selector: WindowSelector
    selection: Selection
    vehicle: VehicleModel | None
    seed: int

    def diagnosis(self, horizon: Horizon) -> Diagnosis:
        chosen, judged = self.selection.chosen, self.judged
        poses = self._poses(chosen)
        static = Predictor(Batch(judged, self.static.predictor.maps, self.geometry))
        predicted = {
            "static": static.predict(self.static.parameters),
            "speed_held": speed_held(static.batch, self.static.parameters),
            "naive": naive(judged),
            "after": poses,
        }
        before = predicted["static"]
        if self.vehicle is not None:
            before = predicted["believed"] = believed(self.vehicle, judged)
        shaken = by_speed_error(Predictor(self._every, chosen.fit.predictor.effects), chosen.fit.parameters)
        rest = self._dependences(poses)
        bounds = bounds_of(self.selector.candidates, chosen.names)
        effects = named_effects(self.selection, bounds)
        held_out = self._held_out(before, poses, shaken)
        # Small structure shows in many windows; what lies at the floor needs no further cause.
        above = any(e["after"] > AT_THE_FLOOR * e["floor"] for e in held_out.errors.values())
        rest = rest if above else []
        far = any(e["after"] > FAR_ABOVE * e["floor"] for e in held_out.errors.values())
        verdict, why = _verdict(effects, rest, far)
        model = corrected_vehicle(self.header, self.geometry, chosen.fit, chosen.fit.predictor.maps, self.seed)
        scatter = self.selector.batch.level_scatter
        return Diagnosis(
            verdict,
            why,
            effects,
            far or bool(rest),
            tuple(rest),
            held_out,
            model,
            self.selection.rejected,
            _provenance(self.header, self.readings, self.seed)
            | {
                "fit_windows": len(self.selector.batch.readings),
                "models_fitted": self.selection.tried,
                "windows": {
                    "horizon_s": horizon.horizon_s,
                    "stride_s": horizon.stride_s,
                    "initial_state_from_s": [-SUPPORT_S, 0.0],
                    "level_scatter": float(scatter),
                    "redundancy": self.selector.batch.redundancy,
                    "recordings": by_recording(judged, predicted, shaken, self.held, self.seed),
                    "effects": self._each(poses),
                },
            },
        )

    def _poses(self, model: Scored) -> Floats:
        """Return what `model` predicts for every window that is judged."""
        batch = self.selector.batch
        if not hasattr(self, "_every"):
            self._every = Batch(self.judged, batch.maps, self.geometry, batch.level_scatter, kinds=batch.kinds)
        return Predictor(self._every, model.fit.predictor.effects).predict(model.fit.parameters)

    def _held_out(self, before: Floats, after: Floats, shaken: Floats) -> HeldOut:
        kept = self.judged.select(self.held)
        least = floor_squares(kept, shaken[self.held])
        was, now = squares(kept, before[self.held]), squares(kept, after[self.held])
        errors = {
            name: {"before": rms(was[name], name), "after": rms(now[name], name), "floor": rms(least[name], name)}
            for name in QUANTITIES
        }
        recording = kept.begins.recording if kept.begins is not None else np.empty(0, dtype=np.str_)
        worse = []
        for name in dict.fromkeys(recording.tolist()):
            own = recording == name
            change = np.nanmean(now["position_rms_mm"][own]) - np.nanmean(was["position_rms_mm"][own])
            if change > np.nanmean(least["position_rms_mm"][own]):
                worse.append(name)
        return HeldOut(len(kept), errors, tuple(worse))

    def _each(self, poses: Floats) -> dict[str, dict[str, object]]:
        """Return for each effect whether it was kept, and the held-out position error with and without it.

        An effect that promised nothing was not fitted: its gain is zero, and there is no error with it.
        """
        chosen = self.selection.chosen
        out: dict[str, dict[str, object]] = {}
        now = self._error(poses)
        for name in self.selector.candidates:
            if name in self.selector.given:
                continue
            kept = name in chosen.names
            if kept:
                other: Scored | None = self.selector.shrunk(self.selection.base, chosen, name)
            else:
                other = self.selector.known((*chosen.names, name))
            error = None if other is None else self._error(self._poses(other))
            out[name] = {
                "kept": kept,
                "gain": self.selection.gains[name] if kept else chosen.total - other.total if other else 0.0,
                "extrapolates": name in self.selector.extrapolating,
                "held_out_position_mm": {"with": now if kept else error, "without": error if kept else now},
            }
        return out

    def _error(self, poses: Floats) -> float:
        name = "position_rms_mm"
        return rms(squares(self.judged.select(self.held), poses[self.held])[name], name)

    def _dependences(self, poses: Floats) -> list[Dependence]:
        """Return what the rest depends on, a stretch of driving being one piece of evidence."""
        rates = residual_rates(self.judged, poses)
        _, stretch = np.unique(self.judged.group, return_inverse=True)
        rates.covariates.pop("distance_m")  # counted from the window's beginning, where a wheel may stand anyhow
        clustered = dataclasses.replace(rates, run=stretch[rates.run].astype(np.int64))
        return dependences(clustered, np.arange(int(stretch.max()) + 1), self.seed)


def _verdict(effects: tuple[NamedEffect, ...], rest: list[Dependence], far: bool) -> tuple[Verdict, str]:
    if rest:
        return Verdict.UNKNOWN, f"structure remains that no effect explains: it depends on {rest[0].covariate}"
    if far:
        return Verdict.UNKNOWN, (
            f"what is missed is more than {FAR_ABOVE:g} times what noise explains, "
            "but depends on none of the covariates looked at"
        )
    if not effects:
        return Verdict.ADEQUATE, "nothing that was looked at predicts better than static maps, fitted again"
    if any(effect.confounded_with for effect in effects):
        return Verdict.AMBIGUOUS, "several effects explain the residual equally well"
    return Verdict.NAMED, "nothing that was looked at explains what the effects named leave"


def _provenance(header: HeaderLike, readings: Readings, seed: int) -> dict[str, object]:
    driven = {run.run_id.rpartition("@")[0] for run in readings.runs}
    return provenance(header, readings, seed, runs_used=len(driven)) | {"windows_used": len(readings)}
