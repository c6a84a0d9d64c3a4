"""Models with more effects or fewer: fitted once, cross-validated, and remembered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.data.window_splits import fold_groups
from agvbench.diagnosis.estimation.cross_validation import FOLDS, cross_validated
from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.estimation.score_test import first_order_gain, initial_parameters
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate, bounds_of, usual
from agvbench.types import Floats

OnProgress = Callable[[str], None]

_SHORT, _LONG = 3, 10
_HOPELESS = 3.0  # an effect with a smaller predicted gain is not fitted
_LIKELY = 40.0  # an effect with a larger one is fitted to convergence
_MOST_STARTS = 2
_WORSE = 20.0  # a fit that has not ended yet may still be so much worse than without the effect
_KEPT = 0.5  # of the predicted gain: a fit that gains less has lost its way


Starts = frozenset[tuple[str, bytes]]
"""Which effects were fitted from other values than the usual, and from which."""


@dataclass(frozen=True)
class Request:
    """A model that is asked for: its effects, and which of them start elsewhere than usual.

    Equal requests have the same answer, whatever was asked for in between.
    """

    names: frozenset[str]
    starts: Starts = frozenset()


@dataclass(frozen=True)
class ScoredModel:
    """A fitted model, the effects in it, each run's cross-validated loss (R,), and its unusual starts."""

    names: tuple[str, ...]
    fit: Fit
    loss: Floats
    starts: Starts = frozenset()

    @property
    def request(self) -> Request:
        """What was asked for."""
        return Request(frozenset(self.names), self.starts)

    @property
    def is_fitted(self) -> bool:
        """Whether the effects were fitted; False for a model that is not worth it and predicts as without the last."""
        return self.fit.predictor.effects == self.names

    @property
    def total(self) -> float:
        """The cross-validated loss of all runs."""
        return float(self.loss.sum())

    def gain_over(self, other: ScoredModel) -> float:
        """Return by how much this model predicts better, and fits better: the lesser of the two.

        Where few runs determine a value of the maps, predicting without them is unreliable, and gains or loses a
        hundred. What does not fit better is no gain.
        """
        return min(other.total - self.total, float(other.fit.loss.sum() - self.fit.loss.sum()))


@dataclass
class FittedModels:
    """Fits models to the runs to be fitted.

    ``given`` are effects that the vehicle is known to have: they stay in every model, with parameters fitted again from
    ``given_values``. ``tried`` counts the models that were fitted.
    """

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

    def __post_init__(self) -> None:
        self._fold = folds(fold_groups(self.batch.readings), FOLDS, self.seed)

    def base(self) -> ScoredModel:
        """Return the model without any effect that the vehicle is not known to have."""
        return self.score(self.given, np.r_[self.start, self.given_values], None)

    def adopt(self, scored_model: ScoredModel) -> ScoredModel:
        """Take over what was fitted elsewhere to runs that this model predicts alike, and return it as one's own."""
        fitted = replace(scored_model.fit, predictor=self._predictor(scored_model.names))
        own = self._known[scored_model.request] = replace(scored_model, fit=fitted)
        return own

    def known(self, names: tuple[str, ...]) -> ScoredModel | None:
        """Return the model with the effects `names`, all from their usual starts, if it was fitted."""
        return self._known.get(Request(frozenset(names)))

    def without_effect(self, base: ScoredModel, current: ScoredModel, name: str) -> ScoredModel:
        """Return the model without the effect called `name`."""
        names = tuple(n for n in current.names if n != name)
        if names == self.given:
            return base
        own = current.fit.effect_values()
        kept = [value for key, value in own.items() if key.partition(".")[0] != name]
        maps = current.fit.parameters[: self.batch.maps.size]
        starts = frozenset(start for start in current.starts if start[0] != name)
        return self.score(names, np.r_[maps, kept], current.fit, starts=starts)

    def with_effect(self, current: ScoredModel, name: str, unusual: Candidate | None = None) -> ScoredModel:
        """Return `current` with the effect called `name`, fitted from the best of its starts.

        These are the usual ones, or those of the candidate `unusual`.
        """
        names = (*current.names, name)
        starts = current.starts if unusual is None else current.starts | unusual.key
        if found := self._known.get(Request(frozenset(names), starts)):
            return found
        try:
            return self._with_effect(current, self._predictor(names), unusual or usual(name), starts)
        except np.linalg.LinAlgError:
            # What runs away to where nothing can be predicted describes nothing.
            return replace(current, names=names)

    def predicted_gain(self, current: ScoredModel, name: str) -> float:
        """Return the predicted gain of the effect `name` beside `current`, to first order, from its best start."""
        return max(self._predicted_gains(current, self._predictor((*current.names, name)), usual(name)))

    @staticmethod
    def _predicted_gains(current: ScoredModel, predictor: Predictor, candidate: Candidate) -> list[float]:
        return [first_order_gain(current.fit, predictor, start, candidate.bounds) for start in candidate.starts]

    def _with_effect(
        self, current: ScoredModel, predictor: Predictor, candidate: Candidate, starts: Starts
    ) -> ScoredModel:
        names, now = predictor.effects, current.fit
        bounds = bounds_of(names)
        predicted_gains = self._predicted_gains(current, predictor, candidate)
        predicted_gain = max(predicted_gains)
        if predicted_gain < _HOPELESS:
            return replace(current, names=names)  # as good as without it, and never chosen
        ordered = [candidate.starts[k] for k in np.argsort(predicted_gains)[::-1]]
        prior_model = candidate.screened and predicted_gain > _LIKELY
        short = self._begun(current, predictor, ordered, bounds, _KEPT * predicted_gain if prior_model else None)
        # A large predicted gain may need a worse fit first: maps that absorbed a cause must give it back.
        if predicted_gain < _LIKELY and float(now.loss.sum() - short.loss.sum()) < _HOPELESS:
            self.tried += 1
            tried = ScoredModel(names, short, cross_validated(short, self._fold, bounds), starts)
            return self._known.setdefault(tried.request, tried)
        return self.score(names, short.parameters, short, starts=starts, patient=prior_model and candidate.foremost)

    def _begun(
        self, current: ScoredModel, predictor: Predictor, starts: list[Floats], bounds: Floats, least: float | None
    ) -> Fit:
        """Return a fit of some steps from the first of `starts`, or the best of them where it gains less than `least`.

        A start is far from the valley, for the maps have absorbed what it adds, and the descent may end anywhere: then
        the maps are first fitted beside it, held where it starts. Where nothing can be expected (`least` is None), that
        is done if the fit ends worse than without, and for a few steps only.
        """
        found = [self._first_steps(current, predictor, starts[0], bounds)]
        iterations = _SHORT if least is None else _LONG
        if current.fit.loss.sum() - found[0].loss.sum() <= (-_WORSE if least is None else least):
            for start in starts[:_MOST_STARTS]:
                held = bounds.copy()
                held[-len(start) :] = start[:, None]
                beside = self._first_steps(current, predictor, start, held, iterations=iterations)
                found.append(self._first_steps(current, predictor, start, bounds, beside, iterations=iterations))
        return min(found, key=lambda one: float(one.loss.sum()))

    @staticmethod
    def _first_steps(
        current: ScoredModel,
        predictor: Predictor,
        start: Floats,
        bounds: Floats,
        beside: Fit | None = None,
        *,
        iterations: int = _SHORT,
    ) -> Fit:
        now = current.fit
        return fit(
            predictor,
            initial_parameters(now, predictor, start) if beside is None else beside.parameters,
            bounds,
            random_effects=(beside or now).random_effects,
            variance_components=(beside or now).variance_components,
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
        """Fit the model with the effects `names` and cross-validate it; what was fitted before is remembered.

        Of these, `starts` begin elsewhere than usual. A `patient` fit is given more steps while they are worth it.
        """
        request = Request(frozenset(names), starts)
        if request not in self._known:
            bounds = bounds_of(names)
            fitted = fit(
                self._predictor(names) if near is None or near.predictor.effects != names else near.predictor,
                parameters,
                bounds,
                random_effects=None if near is None else near.random_effects,
                variance_components=None if near is None else near.variance_components,
                iterations=_LONG,
                patient=patient,
                near=None if near is None else near.linear,
            )
            self.tried += 1
            self._known[request] = ScoredModel(names, fitted, cross_validated(fitted, self._fold, bounds), starts)
        return self._known[request]

    def left(self, smaller: ScoredModel, larger: ScoredModel) -> ScoredModel:
        """Return what is left of `larger` when an effect is dropped that it does not need.

        The smaller model may have been fitted before, from elsewhere, and have ended somewhere else.
        """
        if smaller.names == self.given:
            return smaller
        again = self._known[smaller.request] = self.refitted_from(smaller, larger)
        return again

    def refitted_from(self, model: ScoredModel, beyond: ScoredModel) -> ScoredModel:
        """Return `model` fitted again, patiently, from where the model `beyond` stands, if it predicts better.

        What another model gains may be nothing but the way that its fit went on. Effects that it lacks begin where they
        are in `model`.
        """
        own = model.fit.effect_values() | beyond.fit.effect_values()
        kept = [value for name in model.names for key, value in own.items() if key.partition(".")[0] == name]
        bounds = bounds_of(model.names)
        again = fit(
            self._predictor(model.names), np.r_[beyond.fit.parameters[: self.batch.maps.size], kept], bounds,
            random_effects=beyond.fit.random_effects, variance_components=beyond.fit.variance_components,
            iterations=_LONG, patient=True,
        )  # fmt: skip
        self.tried += 1
        scored_model = ScoredModel(model.names, again, cross_validated(again, self._fold, bounds), model.starts)
        return min(model, scored_model, key=lambda one: one.total)

    def _predictor(self, names: tuple[str, ...]) -> Predictor:
        return Predictor(self.batch, names)
