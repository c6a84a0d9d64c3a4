"""Fits models with different sets of effects, cross-validates them, and caches the results."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import FIT, SELECTION, SelectionCriteria
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.data.window_splits import fold_groups
from agvbench.diagnosis.estimation.cross_validation import FOLDS, cross_validated
from agvbench.diagnosis.estimation.fit import Fit, fit, fit_near
from agvbench.diagnosis.estimation.score_test import first_order_gain, initial_parameters
from agvbench.diagnosis.method import OnProgress
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate, bounds_of, default_candidate
from agvbench.effects import effect_kinds
from agvbench.effects.variants import cause_of
from agvbench.types import Floats

_AT_BOUND = 1e-3
Starts = frozenset[tuple[str, bytes]]
"""Effects that were fitted from other than the default initial values, with these values."""


@dataclass(frozen=True)
class Request:
    """A requested model: its effects, and those of them with other initial values than the default.

    Equal requests have equal results, whatever was requested before.
    """

    names: frozenset[str]
    starts: Starts = frozenset()


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A fitted model: its effects, the cross-validated loss of each run (R,), and non-default initial values."""

    names: tuple[str, ...]
    fit: Fit = field(repr=False)
    loss: Floats = field(repr=False)
    starts: Starts = frozenset()

    @property
    def request(self) -> Request:
        """The request that this model answers."""
        return Request(frozenset(self.names), self.starts)

    @property
    def is_fitted(self) -> bool:
        """Whether the effects were fitted; False if the last one was not, for lack of a predicted gain."""
        return self.fit.predictor.effects == self.names

    @property
    def deviance(self) -> float:
        """The cross-validated deviance: the loss of all runs, and of the priors of maps and effects.

        The prior of the maps is the prediction of nodal values from their neighbours, which no other fold makes. Those
        of effects are observations of their own, whether the model has the effect or lacks it.
        """
        return float(self.loss.sum()) + self.fit.prior.loss

    def is_at_bound(self, name: str) -> bool:
        """Return whether a parameter of an effect of the library lies at a bound other than null.

        The runs then do not determine it, or ask for what the effect cannot be.
        """
        return name in effect_kinds() and bool(self.parameters_at_bound(name))

    def parameters_at_bound(self, name: str) -> set[str]:
        """Return the parameters of an effect or a term that lie at a bound other than null."""
        predictor, bounds = self.fit.predictor, default_candidate(name).bounds
        nulls = predictor.nulls[self._of_effect(name)]
        own = [key.partition(".")[2] for key in predictor.parameter_names if key.partition(".")[0] == name]
        return {
            parameter
            for parameter, value, null, ends in zip(own, self.values_of(name), nulls, bounds, strict=True)
            for end in ends
            if abs(value - end) <= _AT_BOUND * (ends[1] - ends[0]) and end != null
        }

    def values_of(self, name: str) -> Floats:
        """Return the parameters (p,) of an effect or a term."""
        return self.fit.parameters[self.fit.predictor.maps.size :][self._of_effect(name)]

    def _of_effect(self, name: str) -> NDArray[np.bool_]:
        return np.array([key.partition(".")[0] == name for key in self.fit.predictor.parameter_names])

    def gain_over(self, other: ScoredModel) -> float:
        """Return the gain in cross-validated deviance or in deviance of the fit, whichever is smaller.

        If few runs determine a nodal value, predictions without them are unreliable, and the cross-validated deviance
        may differ by a hundred. A gain that does not show in the fit itself does not count.
        """
        return min(other.deviance - self.deviance, self.fit_gain_over(other))

    def fit_gain_over(self, other: ScoredModel) -> float:
        """Return the gain in deviance of the fit, whatever the cross-validated gain."""
        return other.fit.total_loss - self.fit.total_loss

    def is_matched_by(self, other: ScoredModel) -> bool:
        """Return whether `other` predicts as well: by the margin of alternatives this model gains nothing over it."""
        return self.gain_over(other) < SELECTION.alternative_margin


@dataclass
class FittedModels:
    """Fits and cross-validates models of the training runs.

    ``criteria`` are those of the selection. ``given`` are effects that the vehicle is known to have. Every model
    contains them, with parameters fitted from ``given_values``. ``tried`` counts the fitted models.
    """

    criteria: ClassVar[SelectionCriteria] = SELECTION
    batch: Batch
    candidates: dict[str, Candidate]
    start: Floats
    seed: int
    on_progress: OnProgress
    given: tuple[str, ...] = ()
    given_values: Floats = field(default_factory=lambda: np.empty(0))
    tried: int = 0
    _fold: NDArray[np.int64] = field(init=False)
    _known: dict[Request, ScoredModel] = field(init=False, default_factory=dict)
    _gains: dict[tuple[Request, str, Starts], list[float]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._fold = folds(fold_groups(self.batch.readings), FOLDS, self.seed)

    @property
    def given_causes(self) -> set[str]:
        """What the vehicle is known to have: the effects of the library, if variants are given."""
        return {cause_of(name) for name in self.given}

    def base(self) -> ScoredModel:
        """Return the model with the given effects only."""
        return self.score(self.given, np.r_[self.start, self.given_values], None)

    def adopt(self, scored_model: ScoredModel) -> ScoredModel:
        """Add a model that was fitted with another batch, provided that it predicts these runs equally."""
        fitted = replace(scored_model.fit, predictor=self._predictor(scored_model.names))
        own = self._known[scored_model.request] = replace(scored_model, fit=fitted)
        return own

    def known(self, names: tuple[str, ...]) -> ScoredModel | None:
        """Return the cached model with the effects `names` and default initial values, or None."""
        return self._known.get(Request(frozenset(names)))

    def without_effect(self, base: ScoredModel, current: ScoredModel, name: str) -> ScoredModel:
        """Return the model without the effect called `name`.

        Its maps are fitted from those of `current`. If that is much worse, the effect may have distorted them, and they
        are also fitted from those of `base`.
        """
        names = tuple(n for n in current.names if n != name)
        if names == self.given:
            return base
        own = current.fit.effect_values()
        kept = [value for key, value in own.items() if key.partition(".")[0] != name]
        starts = frozenset(start for start in current.starts if start[0] != name)
        maps, base_maps = (model.fit.parameters[: self.batch.maps.size] for model in (current, base))
        without = self.score(names, np.r_[maps, kept], current.fit, starts=starts)
        if current.fit_gain_over(without) < self.criteria.large_loss_of_removal:
            return without
        again = starts | {(f"maps without {name}", base_maps.tobytes())}
        try:
            from_base = self.score(names, np.r_[base_maps, kept], base.fit, starts=again)
        except np.linalg.LinAlgError:
            return without  # the fit diverged
        return min(without, from_base, key=lambda model: model.fit.total_loss)

    def with_effect(
        self, current: ScoredModel, name: str, candidate: Candidate | None = None, *, max_loss: float = math.inf
    ) -> ScoredModel:
        """Return `current` with the effect called `name`, fitted from the best of its initial values.

        These are the initial values of `candidate`, or of the default candidate. A fit that is not expected to reach
        `max_loss` is not finished.
        """
        names = (*current.names, name)
        starts = current.starts if candidate is None else current.starts | candidate.key
        if found := self._known.get(Request(frozenset(names), starts)):
            return found
        try:
            tried = candidate or default_candidate(name)
            return self._with_effect(current, self._predictor(names), tried, starts, max_loss)
        except np.linalg.LinAlgError:
            # A fit that diverges counts as no effect.
            return self.unfitted(current, name)

    @staticmethod
    def unfitted(current: ScoredModel, name: str) -> ScoredModel:
        """Return `current` with an effect that is not fitted: equal to the model without it, and never selected."""
        return replace(current, names=(*current.names, name))

    def predicted_gain(self, current: ScoredModel, name: str, candidate: Candidate | None = None) -> float:
        """Return the predicted gain of the effect `name` beside `current`, to first order, from its best start."""
        try:
            predictor = self._predictor((*current.names, name))
            return max(self._predicted_gains(current, predictor, candidate or default_candidate(name)))
        except np.linalg.LinAlgError:
            return -math.inf  # what cannot be evaluated gains nothing

    def _predicted_gains(self, current: ScoredModel, predictor: Predictor, candidate: Candidate) -> list[float]:
        which = current.request, candidate.name, candidate.key
        if which not in self._gains:
            bounds = candidate.bounds
            self._gains[which] = [first_order_gain(current.fit, predictor, start, bounds) for start in candidate.starts]
        return self._gains[which]

    def _with_effect(
        self, current: ScoredModel, predictor: Predictor, candidate: Candidate, starts: Starts, max_loss: float
    ) -> ScoredModel:
        names, now = predictor.effects, current.fit
        bounds = bounds_of(names)
        predicted_gains = self._predicted_gains(current, predictor, candidate)
        predicted_gain = max(*predicted_gains, candidate.expected_gain)
        if predicted_gain < FIT.min_predicted_gain:
            return self.unfitted(current, candidate.name)
        ordered = [candidate.starts[k] for k in np.argsort(predicted_gains)[::-1]]
        is_likely = candidate.screened and predicted_gain > FIT.large_predicted_gain
        preliminary = self._preliminary_fit(
            current, predictor, ordered, bounds, FIT.min_share_of_predicted_gain * predicted_gain if is_likely else None
        )
        # A large predicted gain may need a worse fit first: maps that absorbed a cause must give it back.
        if (
            predicted_gain < FIT.large_predicted_gain
            and now.total_loss - preliminary.total_loss < FIT.min_predicted_gain
        ):
            return self.unfinished(preliminary, starts)
        if preliminary.total_loss - preliminary.decrement > max_loss:
            return self.unfinished(preliminary, starts)
        return self.score(
            names, preliminary.parameters, preliminary, starts=starts, patient=is_likely and candidate.patient
        )

    def unfinished(self, fitted: Fit, starts: Starts = frozenset()) -> ScoredModel:
        """Return the model of a preliminary fit that is not worth further steps, unless it is cached."""
        self.tried += 1
        names = fitted.predictor.effects
        tried = ScoredModel(names, fitted, cross_validated(fitted, self._fold, bounds_of(names)), starts)
        return self._known.setdefault(tried.request, tried)

    def _preliminary_fit(
        self, current: ScoredModel, predictor: Predictor, starts: list[Floats], bounds: Floats, least: float | None
    ) -> Fit:
        """Return a fit of few iterations from the first of `starts`, or the best of several if that gains too little.

        The maps have absorbed the new effect, so that a start is far from the optimum, and the iteration may end in
        another local minimum. In that case the maps are first fitted with the effect fixed at its start. If no gain can
        be expected (`least` is None), this is done only if the loss is larger than without the effect, and for few
        iterations.
        """
        fits = [self._first_steps(current, predictor, starts[0], bounds)]
        iterations = FIT.few_steps if least is None else FIT.steps
        if current.fit.total_loss - fits[0].total_loss <= (-FIT.max_increase if least is None else least):
            for start in starts[: FIT.max_starts]:
                held = bounds.copy()
                held[-len(start) :] = start[:, None]
                conditional = self._first_steps(current, predictor, start, held, iterations=iterations)
                fits.append(self._first_steps(current, predictor, start, bounds, conditional, iterations=iterations))
        return min(fits, key=lambda one: one.total_loss)

    @staticmethod
    def _first_steps(
        current: ScoredModel,
        predictor: Predictor,
        start: Floats,
        bounds: Floats,
        conditional: Fit | None = None,
        *,
        iterations: int = FIT.few_steps,
    ) -> Fit:
        now = current.fit
        return fit(
            predictor,
            initial_parameters(now, predictor, start) if conditional is None else conditional.parameters,
            bounds,
            random_effects=(conditional or now).random_effects,
            variance_components=(conditional or now).variance_components,
            iterations=iterations,
            near=now.linear,
        )

    def score(
        self,
        names: tuple[str, ...],
        parameters: Floats,
        near: Fit | None,
        *,
        starts: Starts = frozenset(),
        patient: bool = False,
    ) -> ScoredModel:
        """Fit the model with the effects `names` and cross-validate it, unless it is cached.

        `starts` are the non-default initial values among them. A `patient` fit is iterated further as long as it gains.
        """
        request = Request(frozenset(names), starts)
        if request not in self._known:
            bounds = bounds_of(names)
            if near is None:
                fitted = fit(self._predictor(names), parameters, bounds, iterations=FIT.steps, patient=patient)
            else:
                predictor = near.predictor if near.predictor.effects == names else self._predictor(names)
                fitted = fit_near(near, predictor, parameters, bounds, iterations=FIT.steps, patient=patient)
            self.tried += 1
            self._known[request] = ScoredModel(names, fitted, cross_validated(fitted, self._fold, bounds), starts)
        return self._known[request]

    def refitted(self, model: ScoredModel) -> ScoredModel | None:
        """Return a model of other runs, or under other assumptions, fitted to these; None if the fit diverges."""
        try:
            return self.score(model.names, model.fit.parameters, None)
        except np.linalg.LinAlgError:
            return None

    def refitted_if_better(self, model: ScoredModel) -> ScoredModel | None:
        """Return a model of these runs under other assumptions, fitted under those of this selector.

        None if its first steps are not expected to lead to less loss, or if the fit diverges.
        """
        own = model.fit
        try:
            predictor = self._predictor(model.names)
            preliminary = fit_near(own, predictor, own.parameters, own.bounds, iterations=FIT.few_steps)
            if preliminary.total_loss - preliminary.decrement > own.total_loss:
                return None
            return self.score(model.names, preliminary.parameters, preliminary)
        except np.linalg.LinAlgError:
            return None

    def refitted_without(self, base: ScoredModel, current: ScoredModel, name: str) -> ScoredModel:
        """Return the model without the effect called `name`, refitted from `current` if that has the smaller deviance.

        The model without the effect may have been fitted before, by fewer iterations. What further iterations gain is
        no evidence of an effect.
        """
        without = self.without_effect(base, current, name)
        if without.names == self.given:
            return without
        own = current.fit.effect_values()
        kept = [value for key, value in own.items() if key.partition(".")[0] != name]
        parameters = np.r_[current.fit.parameters[: self.batch.maps.size], kept]
        starts = without.starts | {(f"refitted without {name}", parameters.tobytes())}
        try:
            refitted = self.score(without.names, parameters, current.fit, starts=starts, patient=True)
        except np.linalg.LinAlgError:
            return without  # the fit diverged
        return min(without, refitted, key=lambda model: model.deviance)

    def _predictor(self, names: tuple[str, ...]) -> Predictor:
        return Predictor(self.batch, names)
