"""The conclusion: assessment of the selected effects on the test runs, and the verdict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import Split
from agvbench.diagnosis.design.propose import with_next_experiment
from agvbench.diagnosis.discrepancy.campaign_time import columns_by_campaign_time
from agvbench.diagnosis.discrepancy.command_history import command_history
from agvbench.diagnosis.discrepancy.stability import stability_test
from agvbench.diagnosis.findings.corrected_vehicle import corrected_vehicle
from agvbench.diagnosis.findings.effect_states import effect_states
from agvbench.diagnosis.findings.estimates import named_effects
from agvbench.diagnosis.findings.map_structure import map_effects
from agvbench.diagnosis.findings.omitted_effects import omitted_effects
from agvbench.diagnosis.findings.prior_checks import check_priors, provenance_of, with_contradictions, with_evidence
from agvbench.diagnosis.findings.residual_table import with_residuals
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.residuals.body_rates import residual_rates
from agvbench.diagnosis.residuals.covariate_test import RANDOM_PHASE, Dependence, dependences
from agvbench.diagnosis.residuals.periodic import periodic_disturbance
from agvbench.diagnosis.residuals.residuals import MEDIAN, end_covariance
from agvbench.diagnosis.result import Diagnosis, HeldOut, NamedEffect, Verdict
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.validation import Assessment, assess, predictor_for
from agvbench.diagnosis.selection.variants import candidates_for
from agvbench.diagnosis.selection.with_term import TermSelection, with_terms_first
from agvbench.diagnosis.terms import TERMS
from agvbench.model import VehicleModel
from agvbench.types import Floats

_FOUND_AXLE = '; the {0} axle alone drives the vehicle: declare driven = "{0}" in campaign.toml and vehicle.toml'
_REMAINS = "structure remains that no effect explains: "
_DESCRIBE = "describes", "describe"


@dataclass(frozen=True)
class Conclusion:
    """What was selected, and the runs that it is judged by.

    Parameters
    ----------
    context, readings
        The context of the diagnosis, and all runs.
    split
        Training, validation and test runs.
    library, term_selection
        The selection from the library, and the one with discrepancy terms if there are any.
    static
        The maps without effects and with both axles driven, if the selection has one driven axle.
    searched
        Number of runs used in the selection.
    """

    context: DiagnosisContext
    readings: Readings
    split: Split
    library: Selection
    term_selection: TermSelection | None
    static: ScoredModel | None
    searched: int

    @property
    def selection(self) -> Selection:
        """The selection with discrepancy terms, if there are any."""
        return self.term_selection.selection if self.term_selection else self.library

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis; the test runs are opened here, and nothing is selected afterwards."""
        readings, chosen = self.readings, self.selection.chosen
        every = predictor_for(self.library, self.term_selection, readings)
        poses = every.predict(chosen.fit.parameters)
        before = _predicted_before(self.context.vehicle, readings, self.static or self.selection.base)
        covariance = end_covariance(every, chosen.fit)
        # The validation runs influenced the selection, and are not tested; the repeatability depends on no selection.
        tested = assess(readings, self.split.test, before, poses, covariance, repeats=~self.split.training)
        if tested is None:
            return self.context.not_identifiable(
                readings, "there are no repeats among the runs, and so no repeatability"
            )
        rest, likely = self._dependences(every.batch, poses)
        found = with_residuals(self._found(tested, rest, likely), readings, self.split.test, before, poses)
        if self.term_selection:
            return found
        return with_next_experiment(found, self.selection, readings, self.context.header, self.context.seed)

    def _dependences(self, batch: Batch, poses: Floats) -> tuple[list[Dependence], list[Dependence]]:
        """Return the significant and the likely dependences of the residual, with those of repeats."""
        term_selection, seed = self.term_selection, self.context.seed
        rest, likely = _remaining_dependences(batch, poses, term_selection, seed)
        if changes := _changes(batch, self.selection.chosen.fit.parameters, poses, seed):
            terms = len(term_selection.terms) if term_selection else 0
            rest = _with_changes(rest, changes, terms, is_logged=bool(self.readings.logged.columns))
        return rest, likely

    def _found(self, tested: Assessment, rest: list[Dependence], likely: list[Dependence]) -> Diagnosis:
        """Return the diagnosis without the table of residuals and without the run to drive next."""
        context, selection = self.context, self.selection
        fit = selection.chosen.fit
        omitted = omitted_effects(fit)
        checks = check_priors(selection, candidates_for(context.vehicle, context.geometry)[0])
        effects = named_effects(selection, bounds_of(selection.chosen.names), omitted)
        effects = with_evidence(effects + map_effects(fit, context.vehicle), checks)
        significant = self.term_selection is not None or tested.has_lack_of_fit or bool(rest)
        verdict, why = _verdict(effects, significant, rest, self.term_selection)
        if significant and not rest and likely:
            rest, why = likely, f"{_REMAINS}it is likely to depend on {likely[0].covariate}"
        if self.static is not None:
            why += _FOUND_AXLE.format(context.geometry.driven)
        verdict, why = with_contradictions(verdict, why, checks)
        return Diagnosis(
            verdict,
            why,
            effects,
            significant or any(check.contradicted for check in checks),
            tuple(rest),
            _held_out(self.readings.select(self.split.test), tested),
            corrected_vehicle(context.header, context.geometry, fit, fit.predictor.maps, context.seed),
            selection.rejected,
            self._provenance(tested) | provenance_of(checks),
            states=effect_states(fit, effects, omitted),
        )

    def _provenance(self, tested: Assessment) -> dict[str, object]:
        return (
            dict(self.context.provenance(self.readings))
            | _fit_provenance(self.selection, self.readings)
            | _split_provenance(self.split, self.searched, tested)
            | ({"driven_axle": self.context.geometry.driven} if self.static is not None else {})
            | _term_provenance(self.term_selection)
        )


def _predicted_before(vehicle: VehicleModel | None, readings: Readings, static: ScoredModel) -> Floats:
    """Return the poses that the nominal vehicle predicts; without one, those of the static maps."""
    if vehicle is None:
        fitted = static.fit.predictor.batch
        batch = Batch(readings, fitted.maps, fitted.geometry, kinds=fitted.kinds)
        return Predictor(batch, static.names).predict(static.fit.parameters)
    return np.array(vehicle.rollout([run.commands for run in readings.runs], readings.start, list(readings.t_s)))


def _remaining_dependences(
    batch: Batch, poses: Floats, term_selection: TermSelection | None, seed: int
) -> tuple[list[Dependence], list[Dependence]]:
    """Return the significant and the likely dependences of the remaining residual.

    The residual is that of the model without discrepancy terms. The covariates of the terms come first.
    """
    readings, without_term = batch.readings, poses
    if term_selection is not None:
        without = term_selection.without
        without_term = Predictor(batch, without.names).predict(without.fit.parameters)
    rates = residual_rates(readings, without_term)
    likely = dependences(rates, readings.group, seed, readings.start, alpha=RESIDUAL.likely_alpha)
    rest = [d for d in likely if d.p_value < RESIDUAL.dependence_alpha]
    # A position that every run passes can look periodic: the test for a period uses the residual with the term.
    if (periodic := periodic_disturbance(residual_rates(readings, poses), readings.group, seed)) is not None:
        rest = [periodic, *(d for d in rest if d.covariate != RANDOM_PHASE)]
    return (rest if term_selection is None else with_terms_first(rest, term_selection)), likely


def _with_changes(rest: list[Dependence], changes: list[Dependence], at: int, *, is_logged: bool) -> list[Dependence]:
    """Return the dependences with those of repeats after the first `at`; a logged column is listed once."""
    listed = {d.covariate for d in rest[:at]} if is_logged else set()
    changes = [d for d in changes if d.covariate not in listed]
    named = {d.covariate for d in changes} if is_logged else set()
    return [*rest[:at], *changes, *(d for d in rest[at:] if d.covariate not in named)]


def _changes(batch: Batch, parameters: Floats, poses: Floats, seed: int) -> list[Dependence]:
    """Return on what repeats depend that were driven at different times or under other conditions."""
    rates = residual_rates(batch.readings, poses)
    history = command_history(batch, parameters, rates)
    return stability_test(rates, columns_by_campaign_time(rates, history, batch.geometry), batch.readings, seed)


def _fit_provenance(selection: Selection, readings: Readings) -> dict[str, object]:
    random_effects = selection.chosen.fit.variance_components.random_effects
    return {
        "models_fitted": selection.tried,
        "steering_stood_at": "the first command" if readings.preset else "neutral",
        "scatter": {
            "front_deg": float(np.degrees(random_effects[1])),
            "rear_deg": float(np.degrees(random_effects[2])),
            "speed_percent": 100.0 * float(random_effects[3]),
        },
    }


def _term_provenance(term_selection: TermSelection | None) -> dict[str, object]:
    if term_selection is None:
        return {}
    first, *further = term_selection.entries
    return {"empirical_term": first} | ({"further_terms": further} if further else {})


def _split_provenance(split: Split, searched: int, tested: Assessment) -> dict[str, object]:
    return {
        "fit_runs": int(split.training.sum()),
        "searched_runs": searched,
        "validation_runs": int(split.validation.sum()),
        "lack_of_fit_p_value": tested.lack_of_fit,
        "bias_p_value": tested.bias,
        "lack_of_fit_runs": {"tested": int(split.test.sum()), "repeats": int(np.sum(~split.training))},
    }


def _verdict(
    effects: tuple[NamedEffect, ...], significant: bool, rest: list[Dependence], term_selection: TermSelection | None
) -> tuple[Verdict, str]:
    if significant:
        on = f"it depends on {rest[0].covariate if rest else 'none of the covariates tested'}"
        if term_selection is not None:
            on += f", and {term_selection.names} {_DESCRIBE[len(term_selection.terms) > 1]} it"
        elif rest and rest[0].covariate == RANDOM_PHASE:
            on += ", with a random phase in every run, which no plan can compensate"
        return Verdict.UNKNOWN, _REMAINS + on
    if not effects:
        return Verdict.ADEQUATE, "with refitted maps the residual is within repeatability"
    if any(effect.confounded_with for effect in effects):
        return Verdict.AMBIGUOUS, "several effects explain the residual equally well" + _other_forms(effects)
    return Verdict.NAMED, "with the named effects the residual is within repeatability"


def _other_forms(effects: tuple[NamedEffect, ...]) -> str:
    """Return which effects may have another form, a discrepancy term, and the runs that would tell."""
    pairs = [(effect.name, term) for effect in effects for term in TERMS if term.name in effect.confounded_with]
    return "".join(f"; {name} or {term.name}: drive {term.distinguished_by}" for name, term in pairs)


def _held_out(kept: Readings, assessment: Assessment) -> HeldOut:
    before, after = (
        {MEDIAN: residuals.median_mm()} | residuals.rms() for residuals in (assessment.before, assessment.after)
    )
    errors = {
        name: {
            "before": before[name],
            "after": after[name],
            "floor": assessment.repeatability[name],
            "reproducibility": assessment.reproducibility[name],
        }
        for name in before
    }
    was, now = assessment.before.squares()["position_rms_mm"], assessment.after.squares()["position_rms_mm"]
    tolerance = (assessment.repeatability["position_rms_mm"] / 1e3) ** 2
    worse = []
    for g in np.unique(kept.group):
        own = kept.group == g
        if float(np.mean(now[own])) > float(np.mean(was[own])) + tolerance:
            run = kept.runs[int(np.argmax(own))]
            worse.append(run.trajectory or run.run_id)
    return HeldOut(len(kept), errors, tuple(dict.fromkeys(worse)))
