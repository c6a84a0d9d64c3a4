"""The conclusion from windows of free driving: assessment on the test windows, and the verdict."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import Split
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.findings.corrected_vehicle import corrected_vehicle
from agvbench.diagnosis.findings.effect_states import effect_states
from agvbench.diagnosis.findings.estimates import named_effects
from agvbench.diagnosis.findings.omitted_effects import omitted_effects
from agvbench.diagnosis.findings.prior_checks import check_priors, provenance_of, with_contradictions, with_evidence
from agvbench.diagnosis.findings.residual_table import with_residuals
from agvbench.diagnosis.free_driving.command_range import beyond_range, command_ranges
from agvbench.diagnosis.free_driving.drive_level import DriveLevel
from agvbench.diagnosis.free_driving.errors import QUANTITIES, WindowErrors, repeatability_squares, rms, squares
from agvbench.diagnosis.free_driving.predictors import change_by_speed_error, constant_velocity, prior_model, speed_held
from agvbench.diagnosis.free_driving.selection import WindowSelector
from agvbench.diagnosis.free_driving.varying_model import VaryingModel
from agvbench.diagnosis.free_driving.varying_parameters import Variation, at_end_of_recordings
from agvbench.diagnosis.free_driving.window_residuals import WindowResiduals
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.residuals.covariate_test import Dependence, dependences
from agvbench.diagnosis.result import Diagnosis, HeldOut, NamedEffect, Verdict
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.effects.variants import cause_of
from agvbench.types import Floats


@dataclasses.dataclass
class WindowConclusion:
    """Assesses the selection on the test windows.

    ``readings`` are all windows, with their ``split``. Those ``assessed`` (indices) are predicted here. ``static`` are
    the maps without effects, fitted to the training windows. ``levels`` are those of the drive by session.
    """

    context: DiagnosisContext
    readings: Readings
    split: Split
    assessed: NDArray[np.int64]
    static: Fit
    selector: WindowSelector
    selection: Selection
    levels: Mapping[str, DriveLevel]

    @cached_property
    def assessment(self) -> Readings:
        """The windows that are predicted here."""
        return self.readings.select(self.assessed)

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Which of these are test windows, (n,)."""
        return self.split.test[self.assessed]

    def diagnosis(self, horizon: Horizon) -> Diagnosis:
        """Return the diagnosis."""
        context, chosen = self.context, self.selection.chosen
        poses = self._chosen.poses(self._estimates[0])[self.assessed]
        static = Predictor(Batch(self.assessment, self.static.predictor.maps, context.geometry))
        predicted = {
            "static": static.predict(self.static.parameters),
            "speed_held": speed_held(static.batch, self.static.parameters),
            "naive": constant_velocity(self.assessment),
            "population": self._chosen.as_fitted[self.assessed],
            "after": poses,
        }
        before = predicted["static"]
        if context.vehicle is not None:
            before = predicted["believed"] = prior_model(context.vehicle, self.assessment, self.selector.batch.kinds)
        perturbed = change_by_speed_error(self._chosen.predictor, chosen.fit.parameters)[self.assessed]
        checks = check_priors(self.selection, self.selector.candidates)
        omitted = omitted_effects(chosen.fit)
        effects = with_evidence(named_effects(self.selection, bounds_of(chosen.names), omitted), checks)
        held_out = self._held_out(before, poses, perturbed)
        # Many windows make even small structure significant: within repeatability it needs no cause.
        rest = self._dependences(poses) if _above(held_out, RESIDUAL.within_repeatability) else []
        far = self._far_above_noise(held_out)
        verdict, why = with_contradictions(*_verdict(effects, rest, far), checks)
        found = Diagnosis(
            verdict,
            why,
            effects,
            far or bool(rest) or any(check.contradicted for check in checks),
            tuple(rest),
            held_out,
            corrected_vehicle(context.header, context.geometry, chosen.fit, chosen.fit.predictor.maps, context.seed),
            self.selection.rejected,
            context.provenance(self.readings)
            | self._fit_provenance(horizon, predicted, perturbed)
            | provenance_of(checks),
            states=effect_states(chosen.fit, effects, omitted),
        )
        return with_residuals(found, self.assessment, self.held, before, poses)

    def _fit_provenance(self, horizon: Horizon, predicted: dict[str, Floats], perturbed: Floats) -> dict[str, object]:
        """Return the provenance of the fit, with the errors of each predictor and each effect."""
        batch, neutral = self.selector.batch, self.context.header.neutral
        ranges = command_ranges(batch.readings, self.assessment.select(self.held), neutral)
        beyond = beyond_range(self.assessment, ranges, neutral)
        errors = WindowErrors(self.assessment, predicted, perturbed, self.context.seed)
        return {
            "fit_windows": len(batch.readings),
            "models_fitted": self.selection.tried,
            "windows": {
                "horizon_s": horizon.horizon_s,
                "stride_s": horizon.stride_s,
                "level_scatter": float(batch.nodal_deviation),
                "redundancy": batch.autocorrelation_time,
                "initial_steering": "earlier commands" if batch.readings.preset else "measured yaw rate",
                "sessions": self._sessions(),
                "varying": self._varying_parameters(),
                "commands": {role: of_channel.to_table() for role, of_channel in ranges.items()},
                "recordings": errors.by_recording(self.held, beyond),
                "effects": self._effect_errors(predicted["population"]),
            },
        }

    def _sessions(self) -> dict[str, dict[str, object]]:
        """Return the clock offset and the level of the drive of each session, beside those of the others."""
        offsets = self.readings.clock_offsets
        return {
            name: {
                **({"clock_offset": dataclasses.asdict(offsets[name])} if name in offsets else {}),
                **({"drive_level": dataclasses.asdict(self.levels[name])} if name in self.levels else {}),
            }
            for name in dict.fromkeys([*offsets, *self.levels])
        }

    def _varying_parameters(self) -> dict[str, object]:
        """Return how much steering and drive vary, and what they were at the end of each recording."""
        variation, quantities = self._variation, self._chosen.quantities
        names, within = [q.name for q in quantities], [q.name for q in quantities if q.varies_within]
        return {
            "between_recordings": dict(zip(names, variation.between.tolist(), strict=True)),
            "within_recordings": dict(zip(within, variation.within.tolist(), strict=True)),
            "drift_s": variation.drift_s,
            "map_components": len(self._chosen.map_components),
            "recordings": at_end_of_recordings(self._chosen, self._residuals, *self._estimates),
        }

    @cached_property
    def _chosen(self) -> VaryingModel:
        fitted, nodal = self.selection.chosen.fit, slice(self.selector.batch.maps.size)
        predictor = Predictor(self._every, fitted.predictor.effects)
        return VaryingModel(predictor, fitted.parameters, fitted.covariance[nodal, nodal])

    @cached_property
    def _residuals(self) -> WindowResiduals:
        return WindowResiduals.of(self._chosen)

    @cached_property
    def _variation(self) -> Variation:
        """How much steering and drive vary beside the chosen model."""
        return Variation.fitted(self._chosen, self._residuals, self.split.training)

    @cached_property
    def _estimates(self) -> tuple[Floats, Floats]:
        return self._variation.estimates(self._residuals)

    @cached_property
    def _every(self) -> Batch:
        batch = self.selector.batch
        return Batch(self.readings, batch.maps, self.context.geometry, batch.nodal_deviation, kinds=batch.kinds)

    def _held_out(self, before: Floats, after: Floats, perturbed: Floats) -> HeldOut:
        kept = self.assessment.select(self.held)
        least = repeatability_squares(kept, perturbed[self.held])
        was, now = squares(kept, before[self.held]), squares(kept, after[self.held])
        errors = {
            name: {"before": rms(was[name], name), "after": rms(now[name], name), "floor": rms(least[name], name)}
            for name in QUANTITIES
        }
        recording = kept.initial_states.recording if kept.initial_states is not None else np.empty(0, dtype=np.str_)
        worse = []
        for name in dict.fromkeys(recording.tolist()):
            own = recording == name
            change = np.nanmean(now["position_rms_mm"][own]) - np.nanmean(was["position_rms_mm"][own])
            if change > np.nanmean(least["position_rms_mm"][own]):
                worse.append(name)
        return HeldOut(len(kept), errors, tuple(worse))

    def _far_above_noise(self, held_out: HeldOut) -> bool:
        """Return whether an error is far above that of frames and of a vehicle of typical repeatability."""
        kept = self.assessment.select(self.held)
        moved = np.abs(kept.poses[:, -1] - kept.start)
        distance = 1e3 * float(np.sqrt(np.nanmean(moved[:, 0] ** 2 + moved[:, 1] ** 2)))
        turn = float(np.degrees(np.sqrt(np.nanmean(moved[:, 2] ** 2))))
        for name, error in held_out.errors.items():
            typical = RESIDUAL.typical_repeatability * (distance if name.endswith("_mm") else turn)
            if error["after"] > RESIDUAL.far_above_noise * float(np.hypot(error["floor"], typical)):
                return True
        return False

    def _effect_errors(self, poses: Floats) -> dict[str, dict[str, object]]:
        """Return for each effect whether it was selected, and the position error with and without it.

        Both are those of models as fitted, because estimates from earlier windows take the place of a missing effect.
        An effect without predicted gain was not fitted: its gain is zero, and it has no error.
        """
        chosen = self.selection.chosen
        out: dict[str, dict[str, object]] = {}
        now, causes = self._error(poses), {cause_of(name) for name in chosen.names}
        for name in self.selector.candidates:
            kept = name in chosen.names
            if name in self.selector.given or (not kept and cause_of(name) in causes):
                continue
            if kept:
                other: ScoredModel | None = self.selector.without_effect(self.selection.base, chosen, name)
            else:
                other = self.selector.known((*chosen.names, name))
            error = None if other is None else self._error(self._as_fitted(other.fit))
            out[cause_of(name)] = {
                "kept": kept,
                "gain": self.selection.gains[name] if kept else chosen.deviance - other.deviance if other else 0.0,
                "extrapolates": name in self.selector.extrapolating,
                "held_out_position_mm": {"with": now if kept else error, "without": error if kept else now},
            }
        return out

    def _as_fitted(self, fitted: Fit) -> Floats:
        """Return the poses that a model predicts for every assessed window."""
        return Predictor(self._every, fitted.predictor.effects).predict(fitted.parameters)[self.assessed]

    def _error(self, poses: Floats) -> float:
        name = "position_rms_mm"
        return rms(squares(self.assessment.select(self.held), poses[self.held])[name], name)

    def _dependences(self, poses: Floats) -> list[Dependence]:
        """Return the dependences of the residual, with blocks of driving as units."""
        rates = residual_rates(self.assessment, poses)
        _, stretch = np.unique(self.assessment.group, return_inverse=True)
        rates.covariates.pop("distance_m")  # from the beginning of the window, where the wheel angle is arbitrary
        clustered = dataclasses.replace(rates, run=stretch[rates.run].astype(np.int64))
        return dependences(clustered, np.arange(int(stretch.max()) + 1), self.context.seed)


def _above(held_out: HeldOut, times: float) -> bool:
    return any(e["after"] > times * e["floor"] for e in held_out.errors.values())


def _verdict(effects: tuple[NamedEffect, ...], rest: list[Dependence], far: bool) -> tuple[Verdict, str]:
    if rest:
        return Verdict.UNKNOWN, f"structure remains that no effect explains: it depends on {rest[0].covariate}"
    if far:
        return Verdict.UNKNOWN, (
            f"the residuals are more than {RESIDUAL.far_above_noise:g} times what noise explains, "
            "but depend on none of the covariates tested"
        )
    if not effects:
        return Verdict.ADEQUATE, "no effect predicts better than refitted static maps"
    if any(effect.confounded_with for effect in effects):
        return Verdict.AMBIGUOUS, "several effects explain the residual equally well"
    return Verdict.NAMED, "no dependence remains beside the named effects"
