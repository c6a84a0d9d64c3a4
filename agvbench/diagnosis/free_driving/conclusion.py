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
from agvbench.diagnosis.free_driving.describing_term import SelectionWithTerm
from agvbench.diagnosis.free_driving.drive_level import DriveLevel
from agvbench.diagnosis.free_driving.errors import (
    QUANTITIES,
    WindowErrors,
    exceeds_repeatability,
    repeatability_squares,
    rms,
    squares,
)
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
from agvbench.diagnosis.selection.with_term import TermSelection, with_terms_first
from agvbench.effects.variants import cause_of
from agvbench.types import Floats


@dataclasses.dataclass
class WindowConclusion:
    """Assesses the selection on the test windows.

    ``readings`` are all windows, with their ``split``. Those ``assessed`` (indices) are predicted here. ``static`` are
    the maps without effects, fitted to the training windows. ``levels`` are those of the drive by session. ``library``
    is the selection of effects by ``selector``; ``with_term`` is that with a discrepancy term, if there is one.
    """

    context: DiagnosisContext
    readings: Readings
    split: Split
    assessed: NDArray[np.int64]
    static: Fit
    selector: WindowSelector
    library: Selection
    levels: Mapping[str, DriveLevel]
    with_term: SelectionWithTerm | None = None
    _errors: dict[ScoredModel, float] = dataclasses.field(init=False, default_factory=dict)

    @property
    def term(self) -> TermSelection | None:
        """The selection with a discrepancy term, if there is one."""
        return self.with_term.terms if self.with_term else None

    @property
    def selection(self) -> Selection:
        """The selection that predicts: with the discrepancy term, if there is one."""
        return self.term.selection if self.term else self.library

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
        tested = self._tested.readings
        far = exceeds_repeatability(tested, poses[self.held], perturbed[self.held], RESIDUAL.far_above_noise)
        term = self.term
        rest = with_terms_first(rest, term) if term else rest
        verdict, why = with_contradictions(*_verdict(effects, rest, far, term), checks)
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
            | (self._term_provenance(term) if term else {})
            | provenance_of(checks),
            states=effect_states(chosen.fit, effects, omitted),
        )
        return with_residuals(found, self.assessment, self.held, before, poses)

    def _fit_provenance(self, horizon: Horizon, predicted: dict[str, Floats], perturbed: Floats) -> dict[str, object]:
        """Return the provenance of the fit, with the errors of each predictor and each effect."""
        batch, neutral = self.selector.batch, self.context.header.neutral
        ranges = command_ranges(batch.readings, self._tested.readings, neutral)
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
                "effects": self._effect_errors(),
            },
        }

    def _term_provenance(self, term: TermSelection) -> dict[str, object]:
        """Return the entry of the discrepancy term, with the position errors of the test windows with and without it.

        Both are those of models as fitted.
        """
        errors = {"with": self._error_of(term.selection.chosen), "without": self._error_of(term.without)}
        return {"empirical_term": {**term.entries[0], "held_out_position_mm": errors}}

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
        return VaryingModel.of(self.selection.chosen.fit, self._every)

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
        return self.selection.chosen.fit.predictor.batch.repacked(self.readings)

    def _held_out(self, before: Floats, after: Floats, perturbed: Floats) -> HeldOut:
        kept = self._tested.readings
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

    def _effect_errors(self) -> dict[str, dict[str, object]]:
        """Return for each effect whether it was selected, and the position error with and without it.

        Both are those of models as fitted, because estimates from earlier windows take the place of a missing effect.
        An effect with little predicted gain was not fitted: its gain is zero, and it has no error. One that was not
        selected is beside the effects that were selected before a discrepancy term.
        """
        names, out = self.selection.chosen.names, {}
        causes = {cause_of(name) for name in names}
        final = self.selection, self.with_term.selector if self.with_term else self.selector
        for name in self.selector.candidates:
            kept = name in names
            if name in self.selector.given or (not kept and cause_of(name) in causes):
                continue
            with_it, without, gain = _with_and_without(name, *(final if kept else (self.library, self.selector)))
            out[cause_of(name)] = {
                "kept": kept,
                "gain": gain,
                "extrapolates": name in self.selector.extrapolating,
                "held_out_position_mm": {"with": self._error_of(with_it), "without": self._error_of(without)},
            }
        return out

    @cached_property
    def _tested(self) -> Batch:
        """The test windows that are predicted here."""
        return self._every.repacked(self.assessment.select(self.held))

    def _error_of(self, model: ScoredModel | None) -> float | None:
        """Return the position error of a model as fitted in the test windows [mm], or None without a model."""
        if model is None:
            return None
        if model not in self._errors:
            poses = Predictor(self._tested, model.fit.predictor.effects).predict(model.fit.parameters)
            name = "position_rms_mm"
            self._errors[model] = rms(squares(self._tested.readings, poses)[name], name)
        return self._errors[model]

    def _dependences(self, poses: Floats) -> list[Dependence]:
        """Return the dependences of the residual, with blocks of driving as units."""
        rates = residual_rates(self.assessment, poses)
        _, stretch = np.unique(self.assessment.group, return_inverse=True)
        rates.covariates.pop("distance_m")  # from the beginning of the window, where the wheel angle is arbitrary
        clustered = dataclasses.replace(rates, run=stretch[rates.run].astype(np.int64))
        return dependences(clustered, np.arange(int(stretch.max()) + 1), self.context.seed)


def _with_and_without(
    name: str, selection: Selection, selector: WindowSelector
) -> tuple[ScoredModel | None, ScoredModel | None, float]:
    """Return the selected model with and without an effect, None if it was not fitted, and what the effect gains."""
    chosen = selection.chosen
    if name in chosen.names:
        return chosen, selector.without_effect(selection.base, chosen, name), selection.gains[name]
    other = selector.known((*chosen.names, name))
    return other, chosen, chosen.deviance - other.deviance if other else 0.0


def _above(held_out: HeldOut, times: float) -> bool:
    return any(e["after"] > times * e["floor"] for e in held_out.errors.values())


def _verdict(
    effects: tuple[NamedEffect, ...], rest: list[Dependence], far: bool, term: TermSelection | None = None
) -> tuple[Verdict, str]:
    if rest:
        described = f", and {term.names} describes it in the training windows" if term else ""
        return (
            Verdict.UNKNOWN,
            f"structure remains that no effect explains: it depends on {rest[0].covariate}{described}",
        )
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
