"""The diagnosis of runs that begin at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from agvbench.diagnosis.checks.consistency import require_consistent_repeats
from agvbench.diagnosis.checks.sufficiency import insufficient_data
from agvbench.diagnosis.conclusion import Conclusion
from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.readings import Readings, read_runs
from agvbench.diagnosis.data.splits import Split, split_runs, with_other_validation
from agvbench.diagnosis.discrepancy.further_terms import with_further_terms
from agvbench.diagnosis.discrepancy.other_forms import with_other_forms
from agvbench.diagnosis.discrepancy.stepwise import add_term_and_reconsider
from agvbench.diagnosis.method import Method
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps, nodal_maps
from agvbench.diagnosis.model.steady_drives import start_values, steady_drives
from agvbench.diagnosis.result import Diagnosis
from agvbench.diagnosis.selection.actuators import prefer_actuators, separate_lag_from_delay
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.diagnosis.selection.driven_axle import UNDECLARED, better_driven_axle
from agvbench.diagnosis.selection.equal_descriptions import with_equal_descriptions
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.initial_steering import choose_initial_steering, reconsider_initial_steering
from agvbench.diagnosis.selection.lack_of_fit import has_lack_of_fit
from agvbench.diagnosis.selection.refused_effects import with_refused_effects
from agvbench.diagnosis.selection.sequential_replacement import excluded_by_priors, replace_sequentially
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.subsampling import refit_to_all, refit_with_heavy_tails, subsample_repeats
from agvbench.diagnosis.selection.validation import predicts, predicts_left_out, validated, without_effects
from agvbench.diagnosis.selection.variants import (
    candidates_for,
    continued,
    select_variants_and_reconsider,
    with_extended_library,
    with_known_alternatives,
)
from agvbench.diagnosis.selection.with_term import TermSelection
from agvbench.effects.variants import cause_of
from agvbench.model import nominal_model
from agvbench.types import Floats, Run
from agvbench.vehicle.geometry import Driven


@dataclass(frozen=True)
class SelectedFromRest:
    """The selection from the library, that with a discrepancy term if there is one, and its selector.

    ``static`` are the maps without effects and with both axles driven, if the selection has one driven axle. ``split``
    are the runs that were used. ``is_rejected`` says whether the validation runs rejected all that was selected.
    """

    library: Selection
    with_term: TermSelection | None
    selector: Selector
    split: Split
    static: ScoredModel | None = None
    is_rejected: bool = False

    @property
    def chosen(self) -> ScoredModel:
        """The model with the selected effects, and with the terms if there are any."""
        return (self.with_term.selection if self.with_term else self.library).chosen


class RunsFromRest(Method[SelectedFromRest]):
    """Diagnoses runs that begin at rest: each run is one observation, and is predicted from its start pose."""

    no_test: ClassVar[str] = "no run can be spared for the test: drive repeats, or commands in more combinations"

    def read(self, runs: Sequence[Run]) -> Readings:
        """Return the poses of the runs, and the priors of the vehicle file."""
        header = self.context.header
        readings = read_runs(runs, header.neutral, turns_on_the_spot=header.geometry.is_differential)
        return replace(readings, priors=self.context.priors)

    def insufficient_data(self, readings: Readings) -> str:
        """Return why the campaign cannot be diagnosed, or an empty string."""
        reason = insufficient_data(readings, self.context.header)
        if not reason:
            require_consistent_repeats(readings, where=f"campaign {self.context.header.name}")
        return reason

    def split(self, readings: Readings) -> Split:
        """Return the training, validation and test runs; whole groups of runs with equal commands."""
        return split_runs(readings.runs, readings.group, self.context.header.neutral, self.context.seed)

    def select(self, readings: Readings, split: Split) -> SelectedFromRest:
        """Select effects, variants and a discrepancy term in the training runs; validation runs may reject them.

        Validation runs that reject everything show what the training runs lack. They are then added to the training
        runs, and the selection is repeated with other validation runs. Few are left for that: what is selected then
        must also predict the training runs that are left out of its fit. The result is fitted to both parts: validation
        runs that have accepted or rejected a selection determine its parameters like any other run.
        """
        selected = self._accepted(readings, split)
        self.on_progress("fitting the training and validation runs")
        known = readings.select(~selected.split.test)
        library, with_term = refit_to_all(selected.library, selected.with_term, selected.selector, known)
        selected = replace(selected, library=library, with_term=with_term)
        if library.gains and not with_term:
            selected = self._with_further_effects(selected, readings)
        # Losses with heavy tails cannot be compared with others: nothing is selected after this fit.
        library, with_term = refit_with_heavy_tails(selected.library, selected.with_term, selected.selector)
        return replace(selected, library=library, with_term=with_term)

    @staticmethod
    def _with_further_effects(selected: SelectedFromRest, readings: Readings) -> SelectedFromRest:
        """Return what was selected, with effects that are significant in training and validation runs together.

        Some commands may be driven in one direction in the training runs and in the other in the validation runs. An
        effect that only both together show is added if, fitted to the training runs alone, it does not predict the
        validation runs worse.
        """
        library, trained = selected.library, with_extended_library(selected.selector)
        known = replace(readings.select(~selected.split.test), preset=trained.batch.readings.preset)
        every = trained.for_batch(Batch(known, trained.batch.maps, trained.batch.geometry, kinds=trained.batch.kinds))
        every.extended = every
        every.adopt(library.base)
        begun = every.adopt(library.chosen)
        if not every.is_improvable(begun):
            return selected
        again = replace(every.select(begun, map(cause_of, begun.names)), excluded=library.excluded)
        without, with_it = (trained.refitted(model) for model in (library.chosen, again.chosen))
        validation = readings.select(selected.split.validation)
        if without is None or with_it is None or not predicts(with_it, without, validation):
            return selected
        return replace(selected, library=with_other_forms(with_known_alternatives(again, library), every))

    def _accepted(self, readings: Readings, split: Split) -> SelectedFromRest:
        """Return the selection that the validation runs accept, or the maps alone."""
        selected = self._selected(readings, split)
        if not selected.is_rejected:
            return self._predicting(selected) if has_lack_of_fit(selected.chosen) else selected
        again = with_other_validation(
            split, readings.runs, readings.group, self.context.header.neutral, self.context.seed
        )
        if again is None:
            return selected
        self.on_progress("the selection is repeated with these runs among the training runs")
        other = self._selected(readings, again)
        return self._predicting(other) if other.library.gains or other.with_term else selected

    def _predicting(self, selected: SelectedFromRest) -> SelectedFromRest:
        """Return what was selected if it predicts runs that are left out of its fit better than the maps alone.

        While causes are missing, the steps of the cross-validation may be far from a fit without these runs.
        """
        chosen, base = selected.chosen, selected.library.base
        if predicts_left_out(chosen, base, with_extended_library(selected.selector)):
            return selected
        self.on_progress(f"{' + '.join(chosen.names)}: runs that are left out are predicted better without")
        return replace(selected, library=without_effects(selected.library), with_term=None, is_rejected=True)

    def _selected(self, readings: Readings, split: Split) -> SelectedFromRest:
        """Return what the runs of this split select."""
        fitted, validation = readings.select(split.training), int(split.validation.sum())
        self.on_progress(f"{len(fitted)} training runs, {validation} validation runs, {split.test.sum()} test runs")
        searched = fitted.select(subsample_repeats(fitted.group, DATA.max_selection_runs))
        library, selector = self._selected_effects(self.selector(searched))
        static = None
        if axle := self._undeclared_axle(library, selector):
            self.on_progress(f"driven by the {axle} axle: predicts better")
            static = library.base
            library, selector = self._selected_effects(self._under(axle).selector(searched))
        self.on_progress("comparing terms for what no effect of the library describes")
        library, with_term, selector = add_term_and_reconsider(library, selector)
        if with_term is not None:
            with_term = with_further_terms(with_term, with_extended_library(selector))
        if len(searched) < len(fitted):
            self.on_progress(f"effects were selected in {len(searched)} runs; they are refitted to all {len(fitted)}")
        return self._refitted_and_validated(SelectedFromRest(library, with_term, selector, split, static), readings)

    @staticmethod
    def _selected_effects(selector: Selector) -> tuple[Selection, Selector]:
        """Return the effects of the library with their variants, and the selector with their initial steering."""
        chosen, selector = reconsider_initial_steering(selector.select(), selector)
        if chosen.gains:
            selector.on_progress("comparing other equations of the selected effects")
        library, selector = select_variants_and_reconsider(chosen, selector)
        library = continued(separate_lag_from_delay(prefer_actuators(library, selector), selector), library, selector)
        library = with_refused_effects(library, selector)
        if library.gains:
            selector.on_progress("comparing each selected effect with others in its place")
            # What another effect replaced may be necessary beside it: both were never compared together.
            library = continued(replace_sequentially(library, selector), library, selector)
            library = with_equal_descriptions(library, chosen.chosen, selector)
            library = excluded_by_priors(library, selector)
        return library, selector

    def _under(self, axle: Driven) -> RunsFromRest:
        """Return this method for a vehicle that one axle drives."""
        geometry = replace(self.context.geometry, driven=axle)
        return RunsFromRest(replace(self.context, geometry=geometry), self.on_progress)

    def _undeclared_axle(self, library: Selection, selector: Selector) -> Driven | None:
        """Return the axle that alone drives the vehicle, if no file declares it and the runs show it."""
        geometry = self.context.geometry
        is_open = geometry.driven == UNDECLARED and not geometry.is_differential
        return better_driven_axle(library, selector) if is_open else None

    def conclude(self, readings: Readings, split: Split, selected: SelectedFromRest) -> Diagnosis:
        """Open the test runs, and return the diagnosis."""
        batch, split = selected.selector.batch, selected.split
        readings = replace(readings, preset=batch.readings.preset)
        context = replace(self.context, geometry=batch.geometry)
        return Conclusion(
            context, readings, split, selected.library, selected.with_term, selected.static, len(batch.readings)
        ).diagnosis()

    def _refitted_and_validated(self, selected: SelectedFromRest, readings: Readings) -> SelectedFromRest:
        """Return the selection refitted to all training runs, or the maps alone if validation rejects it."""
        library, with_term, selector = selected.library, selected.with_term, selected.selector
        split, has_any = selected.split, bool(library.gains) or with_term is not None
        fitted = readings.select(split.training)
        if len(selector.batch.readings) < len(fitted):
            library, with_term = refit_to_all(library, with_term, selector, fitted)
        library, with_term = validated(library, with_term, readings.select(split.validation), self.on_progress)
        is_rejected = has_any and not library.gains and with_term is None
        return replace(selected, library=library, with_term=with_term, is_rejected=is_rejected)

    def selector(self, readings: Readings) -> Selector:
        """Return the selector for these runs, with the better of both initial states of the steering."""
        context = self.context
        neutral, geometry = context.header.neutral, context.geometry
        maps = nodal_maps(readings.runs, neutral, is_differential=geometry.is_differential)
        start = start_values(maps, steady_drives(readings.runs, geometry, neutral), _prior_values(maps, context))
        tried, kinds = candidates_for(context.vehicle, context.geometry)
        batch = Batch(readings, maps, context.geometry, kinds=kinds)
        given = given_effects(context.vehicle, tried)
        return choose_initial_steering(Selector(batch, tried, start, context.seed, self.on_progress, *given))


def _prior_values(maps: NodalMaps, context: DiagnosisContext) -> dict[str, Floats]:
    """Return the values of the vehicle model before (or the nominal one) at the nodes of the maps, by role."""
    header = context.header
    model = context.vehicle or nominal_model(header.vehicle_name, context.geometry, header.channels)
    return {role: np.asarray(getattr(model, role)(maps.nodes[role])) for role in ROLES}
