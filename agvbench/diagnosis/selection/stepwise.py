"""Stepwise selection of the effects that the model needs, and of their indistinguishable alternatives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self, TypeVar

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.cross_validation import differs_from_null, fits_better, trimmed_gain
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.residuals import pose_residuals
from agvbench.diagnosis.selection.fitted_models import FittedModels, ScoredModel
from agvbench.effects import effect_kinds
from agvbench.effects.variants import cause_of


@dataclass(frozen=True)
class ExcludedAlternative:
    """An alternative that predicts as well without the priors of effects: its ``gain`` in deviance, and its ``fit``."""

    gain: float
    fit: Fit


@dataclass(frozen=True)
class Selection:
    """The result of a selection.

    ``base`` is the model with the given effects only. ``chosen`` is the model with all effects that meet the selection
    criterion. ``alternatives`` maps each selected effect to those that predict as well in its place, with their
    difference in deviance, and ``excluded`` to those that would without the priors of effects. ``gains`` are the
    increases of deviance when a selected effect is removed. ``rejected`` are the gains of effects that do not meet the
    criterion. ``tried`` counts the fitted models.
    """

    base: ScoredModel
    chosen: ScoredModel
    alternatives: dict[str, dict[str, float]]
    gains: dict[str, float]
    rejected: dict[str, float]
    tried: int
    excluded: dict[str, dict[str, ExcludedAlternative]] = field(default_factory=dict)


@dataclass
class Selector(FittedModels):
    """Fits effects to the training runs, and selects those that meet the criterion.

    ``extended`` is the selector of the same runs with the extended library, once it was needed. ``further_kinds`` names
    what that library contains: by default every variant and term. `select` computes alternatives if
    ``finds_alternatives``. ``always_fitted`` are effects that are fitted in every step, whatever they are predicted to
    gain.
    """

    further_kinds: ClassVar[frozenset[str] | None] = None
    finds_alternatives: ClassVar[bool] = True
    always_fitted: ClassVar[frozenset[str]] = frozenset()
    extended: Self | None = field(init=False, default=None)

    @property
    def models_fitted(self) -> int:
        """The number of fitted models, with and without the extended library."""
        return self.tried + (0 if self.extended is None else self.extended.tried)

    @property
    def min_gain(self) -> float:
        """The least gain of an effect, corrected for the number of candidates."""
        return self.criteria.min_gain + 2.0 * math.log(max(len(self.candidates), 1))

    def further(self, current: ScoredModel) -> list[str]:
        """Return the candidates with other causes than `current` has; a variant only where it is simulated."""
        causes = {cause_of(name) for name in current.names}
        simulated = effect_kinds().keys() | {kind.name for kind in self.batch.kinds}
        return [name for name in self.candidates if cause_of(name) not in causes and name in simulated]

    def for_batch(self, batch: Batch) -> Self:
        """Return a selector with the same candidates for another batch, with an empty cache."""
        return replace(self, batch=batch, candidates=dict(self.candidates), tried=0)

    def select(self, begun: ScoredModel | None = None, group: Iterable[str] = ()) -> Selection:
        """Add effects until none meets the criterion, then remove those without which the model predicts as well.

        A model that was `begun` is continued; its effects with a cause in `group` are alike.
        """
        current = self.base() if begun is None else begun
        while True:  # ends when no effect meets the criterion: there are only so many candidates
            larger, gains = self.step(current)
            if larger is None:
                return self.completed(current, gains, group)
            current = larger

    def step(self, current: ScoredModel) -> tuple[ScoredModel | None, dict[str, float]]:
        """Return `current` with the best effect that meets the criterion, None if none does, and the gain of each."""
        tried, accepted = self._with_one_more(current)
        gains = {name: model.gain_over(current) for name, model in tried.items()}
        if not accepted:
            return None, gains
        larger = self.preferred(accepted)
        self.on_progress(f"{' + '.join(larger.names)}: gains {self.base().deviance - larger.deviance:.0f}")
        return larger, gains

    def completed(self, current: ScoredModel, rejected: dict[str, float], group: Iterable[str] = ()) -> Selection:
        """Return the selection of `current` without the effects that it does not need; `rejected` gain too little."""
        base = self.base()
        current, gains = self.backward_elimination(base, current, group)
        alternatives = self.alternatives(base, current) if self.finds_alternatives else {}
        rejected = {name: gain for name, gain in rejected.items() if name not in current.names}
        return Selection(base, current, alternatives, gains, rejected, self.models_fitted)

    def _with_one_more(self, current: ScoredModel) -> tuple[dict[str, ScoredModel], list[ScoredModel]]:
        """Return `current` with each further candidate, in the order of predicted gains, and those that improve it.

        What is predicted to gain much less than another one does gain is left to the next step. What is predicted to
        gain too little is not fitted.
        """
        names = self.further(current)
        predicted = {name: self.predicted_gain(current, name) for name in names}
        larger: dict[str, ScoredModel] = {}
        accepted: list[ScoredModel] = []
        most = 0.0
        for name in sorted(names, key=lambda name: -predicted[name]):
            if accepted and predicted[name] < self.criteria.superior_share * most:
                break
            if self._is_unlikely(name, predicted[name]):
                larger[name] = self.unfitted(current, name)
                continue
            larger[name] = model = self.with_effect(current, name, max_loss=self.max_loss_of_further(current, name))
            if self.improves(current, model):
                accepted.append(model)
                most = max(most, model.gain_over(current))
        return larger, accepted

    def _is_unlikely(self, name: str, predicted: float) -> bool:
        """Return whether too little gain of an effect is predicted to fit it."""
        share = self.criteria.likely_gain_share
        return share > 0.0 and predicted < share * self.min_gain and cause_of(name) not in self.always_fitted

    def max_loss_of_further(self, current: ScoredModel, name: str) -> float:
        """Return the loss that a fit of one more effect must be expected to reach to be finished: any.

        In further steps random effects may give back much of a cause.
        """
        return math.inf

    def is_improvable(self, current: ScoredModel) -> bool:
        """Return whether a further candidate improves a model; those that are predicted to gain too little do not."""
        names = self.further(current)
        predicted = {name: self.predicted_gain(current, name) for name in names}
        likely = [name for name in names if predicted[name] > self.criteria.superior_share * self.min_gain]
        return any(
            self.improves(current, self.with_effect(current, name))
            for name in sorted(likely, key=lambda name: -predicted[name])
        )

    def preferred(self, models: list[ScoredModel]) -> ScoredModel:
        """Return the model of least deviance."""
        return min(models, key=lambda model: model.deviance)

    def meets_criterion(self, without: ScoredModel, with_it: ScoredModel, *, of_group: bool = False) -> bool:
        """Return whether the effects in `with_it` but not in `without` meet the selection criterion.

        An effect that is one `of_group` need not change the prediction noticeably: others of its group take its place.
        Nor need one that a prior states: the same prediction by other effects contradicts the prior.
        """
        added = set(with_it.names) - set(without.names)
        by_gain = of_group and self.criteria.group_by_gain
        return self.improves(without, with_it, of_group=of_group) and (
            by_gain or all(self._differs_from_null(without, with_it, n) and not with_it.is_at_bound(n) for n in added)
        )

    def _differs_from_null(self, without: ScoredModel, with_it: ScoredModel, name: str) -> bool:
        """Return whether an added effect is significant, by Wald's test or by the likelihood ratio."""
        group = self.batch.readings.group
        return differs_from_null(with_it.fit, name, group) or (
            self.criteria.by_likelihood_ratio and fits_better(without.fit, with_it.fit, name, group)
        )

    def improves(self, without: ScoredModel, with_it: ScoredModel, *, of_group: bool = False) -> bool:
        """Return whether `with_it` predicts enough better than `without`: the selection criterion but for Wald's test.

        While causes are missing, their residuals widen the standard errors of the others: Wald's test decides about the
        whole model, in the backward elimination.
        """
        gain, group = without.loss - with_it.loss, self.batch.readings.group
        by_gain = of_group and self.criteria.group_by_gain
        by_priors = without.fit.prior.loss - with_it.fit.prior.loss
        return bool(
            with_it.gain_over(without) > (self.criteria.min_gain if by_gain else self.min_gain)
            and by_priors + trimmed_gain(gain, group, self.criteria.trimmed_share) > 0.0
            and (of_group or self._is_stated(without, with_it) or self._changes_prediction(without, with_it))
        )

    def _is_stated(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        """Return whether the priors of effects alone gain enough to add the effects."""
        return without.fit.prior.of_effects - with_it.fit.prior.of_effects > self.min_gain

    def _changes_prediction(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        """Return whether the change of the prediction is large enough relative to the larger model's residuals."""
        readings = self.batch.readings
        small, large = (model.fit.predictor.predict(model.fit.parameters) for model in (without, with_it))
        residuals = pose_residuals(readings, large).squares()
        moved = pose_residuals(
            replace(readings, poses=np.where(readings.seen[..., None], small, np.nan)), large
        ).squares()
        return any(
            float(np.mean(moved[name])) > self.criteria.min_relative_change**2 * float(np.mean(residuals[name]))
            for name in ("position_rms_mm", "heading_rms_deg")
        )

    def _added_effects(self, current: ScoredModel) -> tuple[str, ...]:
        return tuple(name for name in current.names if name not in self.given)

    def backward_elimination(
        self, base: ScoredModel, current: ScoredModel, group: Iterable[str] = ()
    ) -> tuple[ScoredModel, dict[str, float]]:
        """Remove effects that do not meet the criterion; return the model and the gain of each effect in it.

        Effects with a cause in `group` are alike, and are judged by their gain alone.
        """
        alike = {*group}
        while found := self._added_effects(current):
            smaller = {name: self.without_effect(base, current, name) for name in found}
            gains = {name: model.deviance - current.deviance for name, model in smaller.items()}
            unnecessary = [
                name
                for name, model in smaller.items()
                if not self.meets_criterion(model, current, of_group=cause_of(name) in alike)
            ]
            if not unnecessary:
                return current, gains
            current = smaller[min(unnecessary, key=lambda name: gains[name])]
        return current, {}

    def alternatives(
        self, base: ScoredModel, current: ScoredModel, among: Mapping[str, Iterable[str]] | None = None
    ) -> dict[str, dict[str, float]]:
        """Return the alternatives of each selected effect, with their difference in deviance.

        Parameters
        ----------
        base, current
            The model with the given effects only, and the selected model.
        among
            By effect, the others that are fitted in its place; every candidate for effects that it does not contain.
        """
        found, further, causes = {}, self.further(current), {cause_of(name) for name in current.names}
        for name in self._added_effects(current):
            without = self.without_effect(base, current, name)
            among_these = (among or {}).get(name, further)
            others = [n for n in among_these if cause_of(n) not in causes]
            worse = {n: m.deviance - current.deviance for n, m in self.likely(without, current, others).items()}
            found[name] = {
                n: difference for n, difference in worse.items() if difference < SELECTION.alternative_margin
            }
        return found

    def likely(self, without: ScoredModel, current: ScoredModel, others: Iterable[str]) -> dict[str, ScoredModel]:
        """Return `without` with each of the `others`, but for those that cannot take the place of what `current` has.

        They are predicted to gain less than `likely_share` of what `current` gains over `without`.
        """
        least, max_loss = self.criteria.likely_share * current.fit_gain_over(without), self.max_loss_of_likely(current)
        likely = (name for name in others if self.predicted_gain(without, name) >= least)
        return {name: self.with_effect(without, name, max_loss=max_loss) for name in likely}

    def max_loss_of_likely(self, current: ScoredModel) -> float:
        """Return the loss that an effect in the place of what `current` has must be expected to reach: any.

        In further steps random effects may absorb much of it.
        """
        return math.inf


AnySelector = TypeVar("AnySelector", bound=Selector)
