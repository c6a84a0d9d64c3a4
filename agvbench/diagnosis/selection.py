"""Which effects the model needs, and which others would do as well."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.candidates import Candidate, bounds_of
from agvbench.diagnosis.fitting import Fit, fit
from agvbench.diagnosis.grouping import folds
from agvbench.diagnosis.judging import FOLDS, cross_validated, differs_from_nothing, without_best
from agvbench.diagnosis.prediction import Batch, Predictor
from agvbench.diagnosis.promises import promised_gain
from agvbench.diagnosis.residuals import misses
from agvbench.diagnosis.windows_split import fold_groups
from agvbench.types import Floats

Tell = Callable[[str], None]

LEAST_GAIN = 12.0
"""Least cross-validated gain in minus two log likelihood that earns an effect its place, before the correction for
having tried many: each effect tried adds as if its gain came from one of so many."""

RIVAL_MARGIN = 10.0
"""An effect that predicts this much worse, or less, in place of a named one is its rival."""

NOTICEABLE = 0.15
"""An effect has to move the prediction by this part of what remains unpredicted, be it ever so certain."""

_NEARLY_RIVAL = 100.0  # a rival may look so much worse because its fit ended sooner
_SHORT, _LONG = 3, 10
_HOPELESS = 3.0  # what promises less, to first order, is not fitted
_LIKELY = 40.0  # what promises more is fitted to the end
_MOST_EFFECTS = 4
_MOST_STARTS = 2
_WORSE = 20.0  # a fit that has not ended yet may still be so much worse than without the effect
_KEPT = 0.5  # of what is promised: a fit that gains less has lost its way


@dataclass(frozen=True)
class Scored:
    """A fitted model, the effects in it, and each run's cross-validated loss (R,)."""

    names: tuple[str, ...]
    fit: Fit
    loss: Floats

    @property
    def total(self) -> float:
        """The cross-validated loss of all runs."""
        return float(self.loss.sum())


@dataclass(frozen=True)
class Selection:
    """What was chosen.

    ``base`` is the model without effects, ``chosen`` the one with all that earned their place; ``rivals`` by named
    effect the others that would do in its place, with how much worse they predict; ``gains`` by named effect what its
    loss would cost; ``tried`` how many models were fitted, ``rejected`` the gain of each effect that did not earn its
    place.
    """

    base: Scored
    chosen: Scored
    rivals: dict[str, dict[str, float]]
    gains: dict[str, float]
    rejected: dict[str, float]
    tried: int


@dataclass
class Selector:
    """Tries effects on the runs to be fitted.

    ``given`` are effects that the vehicle is known to have: they stay in every model, with parameters fitted again from
    ``given_values``. ``wide`` keeps a batch with more than the library, once one was needed.
    """

    batch: Batch
    candidates: dict[str, Candidate]
    start: Floats
    seed: int
    tell: Tell
    given: tuple[str, ...] = ()
    best_share: ClassVar[float] = 0.05
    noticeable: ClassVar[float] = NOTICEABLE
    given_values: Floats = field(default_factory=lambda: np.empty(0))
    tried: int = 0
    wide: Batch | None = field(init=False, default=None)
    _fold: NDArray[np.int64] = field(init=False)
    _known: dict[tuple[str, ...], Scored] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._fold = folds(fold_groups(self.batch.readings), FOLDS, self.seed)

    @property
    def least_gain(self) -> float:
        """What an effect must gain, corrected for the number of effects that are tried for each place."""
        return LEAST_GAIN + 2.0 * math.log(max(len(self.candidates), 1))

    def base(self) -> Scored:
        """Return the model without any effect that the vehicle is not known to have."""
        return self.score(self.given, np.r_[self.start, self.given_values], None)

    def over(self, batch: Batch) -> Selector:
        """Return a selector like this one of other runs, which knows nothing yet."""
        return Selector(batch, dict(self.candidates), self.start, self.seed, self.tell, self.given, self.given_values)

    def adopt(self, scored: Scored) -> Scored:
        """Take over what was fitted elsewhere to runs that this model predicts alike, and return it as one's own."""
        fitted = replace(scored.fit, predictor=self._predictor(scored.names))
        self._known[tuple(sorted(scored.names))] = own = replace(scored, fit=fitted)
        return own

    def select(self) -> Selection:
        """Add effects until none gains, then drop those without which the model predicts as well."""
        base = current = self.base()
        rejected: dict[str, float] = {}
        while len(current.names) < len(self.given) + _MOST_EFFECTS:
            offers = {name: self.grown(current, name) for name in self.candidates if name not in current.names}
            rejected = {name: current.total - offer.total for name, offer in offers.items()}
            worthy = {name: offer for name, offer in offers.items() if self.earns(current, offer)}
            if not worthy:
                break
            current = min(worthy.values(), key=lambda offer: offer.total)
            self.tell(f"{' + '.join(current.names)}: gains {base.total - current.total:.0f}")
        current, gains = self.pruned(base, current)
        current, rivals = self.exchanged(base, current)
        if set(current.names) != set(gains) | set(self.given):
            current, gains = self.pruned(base, current)
            rivals = {name: others for name, others in rivals.items() if name in gains}
        rejected = {name: gain for name, gain in rejected.items() if name not in current.names}
        return Selection(base, current, rivals, gains, rejected, self.tried)

    def earns(self, without: Scored, with_it: Scored) -> bool:
        """Whether the larger model predicts better by enough, not in a few groups of runs alone, and to be noticed."""
        gain = without.loss - with_it.loss
        return bool(
            gain.sum() > self.least_gain
            and without_best(gain, self.batch.readings.group, self.best_share) > 0.0
            and self._noticeable(without, with_it)
            and all(
                differs_from_nothing(with_it.fit, name, self.batch.readings.group)
                for name in set(with_it.names) - set(without.names)
            )
        )

    def _noticeable(self, without: Scored, with_it: Scored) -> bool:
        """Whether the prediction moves by a noticeable part of what the larger model misses anyway."""
        readings = self.batch.readings
        small, large = (model.fit.predictor.predict(model.fit.parameters) for model in (without, with_it))
        missed = misses(readings, large).squares()
        moved = misses(replace(readings, poses=np.where(readings.seen[..., None], small, np.nan)), large).squares()
        return any(
            float(np.mean(moved[name])) > self.noticeable**2 * float(np.mean(missed[name]))
            for name in ("position_rms_mm", "heading_rms_deg")
        )

    def _found(self, current: Scored) -> tuple[str, ...]:
        return tuple(name for name in current.names if name not in self.given)

    def pruned(self, base: Scored, current: Scored) -> tuple[Scored, dict[str, float]]:
        """Return the model with only the effects that earn their place, and what the loss of each would cost."""
        while found := self._found(current):
            smaller = {name: self.shrunk(base, current, name) for name in found}
            gains = {name: model.total - current.total for name, model in smaller.items()}
            useless = [name for name, model in smaller.items() if not self.earns(model, current)]
            if not useless:
                return current, gains
            current = self.left(smaller[min(useless, key=lambda name: gains[name])], current)
        return current, {}

    def exchanged(
        self, base: Scored, current: Scored, among: Mapping[str, Iterable[str]] | None = None
    ) -> tuple[Scored, dict[str, dict[str, float]]]:
        """Return the model with any effect replaced by another that predicts better in its place, and the rivals left.

        What was chosen first was chosen in the place of all the others, too, and may only look like one of them.

        Parameters
        ----------
        base, current
            The model without effects, and the one to judge.
        among
            By effect, which others are tried in its place; by default every candidate.
        """
        for _ in range(_MOST_EFFECTS):
            swapped = {
                name: {
                    other: self.grown(self.shrunk(base, current, name), other)
                    for other in (self.candidates if among is None else among.get(name, ()))
                    if other not in current.names
                }
                for name in self._found(current)
            }
            better = [
                offer
                for name, offers in swapped.items()
                for offer in offers.values()
                if offer.total < current.total - LEAST_GAIN and self.earns(self.shrunk(base, current, name), offer)
            ]
            if not better:
                break
            best = min(better, key=lambda offer: offer.total)
            self.tell(f"{' + '.join(best.names)} in place of {' + '.join(current.names)}")
            current = best
        worse = {n: {o: self._worse(offer, current) for o, offer in offers.items()} for n, offers in swapped.items()}
        rivals = {n: {o: w for o, w in others.items() if w < RIVAL_MARGIN} for n, others in worse.items()}
        return current, {name: others for name, others in rivals.items() if name in current.names}

    def _worse(self, offer: Scored, current: Scored) -> float:
        """Return by how much another effect predicts worse, its fit carried on from where the chosen one stands."""
        worse = offer.total - current.total
        if RIVAL_MARGIN <= worse < _NEARLY_RIVAL and offer.fit.predictor.effects == offer.names:
            worse = self.retried(offer, current).total - current.total
        return worse

    def shrunk(self, base: Scored, current: Scored, name: str) -> Scored:
        """Return the model without the effect called `name`."""
        names = tuple(n for n in current.names if n != name)
        if names == self.given:
            return base
        own = current.fit.effect_values()
        kept = [value for key, value in own.items() if key.partition(".")[0] != name]
        maps = current.fit.parameters[: self.batch.maps.size]
        return self.score(names, np.r_[maps, kept], current.fit)

    def grown(self, current: Scored, name: str) -> Scored:
        """Return `current` with the effect called `name`, fitted from the best of its starts."""
        names = (*current.names, name)
        key = tuple(sorted(names))
        if key in self._known:
            return self._known[key]
        predictor = self._predictor(names)
        bounds = bounds_of(self.candidates, names)
        candidate, now = self.candidates[name], current.fit
        promises = [promised_gain(now, predictor, start, candidate.bounds) for start in candidate.starts]
        best = int(np.argmax(promises))
        if promises[best] < _HOPELESS:
            return replace(current, names=names)  # as good as without it, and never chosen
        ordered = [candidate.starts[k] for k in np.argsort(promises)[::-1]]
        believed = candidate.screened and promises[best] > _LIKELY
        short = self._begun(current, predictor, ordered, bounds, _KEPT * promises[best] if believed else None)
        # What promises much may have to climb first: maps that took up a cause must give it back before it shows.
        if promises[best] < _LIKELY and float(now.loss.sum() - short.loss.sum()) < _HOPELESS:
            self.tried += 1
            self._known[key] = Scored(names, short, cross_validated(short, self._fold, bounds))
        return self.score(names, short.parameters, short, patient=believed and candidate.foremost)

    def _begun(
        self, current: Scored, predictor: Predictor, starts: list[Floats], bounds: Floats, least: float | None
    ) -> Fit:
        """Return a fit of some steps from the first of `starts`, or the best of them where it gains less than `least`.

        A start is far from the valley, for the maps have taken up what it adds, and the way down may end anywhere: then
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
        current: Scored,
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
            np.r_[now.parameters, start] if beside is None else beside.parameters,
            bounds,
            offsets=(beside or now).offsets,
            scatter=(beside or now).scatter,
            iterations=iterations,
            near=now.linear,
        )

    def score(self, names: tuple[str, ...], parameters: Floats, near: Fit | None, *, patient: bool = False) -> Scored:
        """Fit the model with the effects `names` and cross-validate it; what was fitted before is remembered.

        A `patient` fit is given more steps while they are worth it.
        """
        key = tuple(sorted(names))
        if key not in self._known:
            bounds = bounds_of(self.candidates, names)
            fitted = fit(
                self._predictor(names) if near is None or near.predictor.effects != names else near.predictor,
                parameters,
                bounds,
                offsets=None if near is None else near.offsets,
                scatter=None if near is None else near.scatter,
                iterations=_LONG,
                patient=patient,
                near=None if near is None else near.linear,
            )
            self.tried += 1
            self._known[key] = Scored(names, fitted, cross_validated(fitted, self._fold, bounds))
        return self._known[key]

    def left(self, smaller: Scored, larger: Scored) -> Scored:
        """Return what is left of `larger` when an effect is dropped that it does not need.

        The smaller model may have been fitted before, from elsewhere, and have ended somewhere else.
        """
        if smaller.names == self.given:
            return smaller
        again = self._known[tuple(sorted(smaller.names))] = self.retried(smaller, larger)
        return again

    def retried(self, model: Scored, beyond: Scored) -> Scored:
        """Return `model` fitted again, patiently, from where the model `beyond` stands, if it predicts better.

        What another model gains may be nothing but the way that its fit went on. Effects that it lacks begin where they
        are in `model`.
        """
        own = model.fit.effect_values() | beyond.fit.effect_values()
        kept = [value for name in model.names for key, value in own.items() if key.partition(".")[0] == name]
        bounds = bounds_of(self.candidates, model.names)
        again = fit(
            self._predictor(model.names), np.r_[beyond.fit.parameters[: self.batch.maps.size], kept], bounds,
            offsets=beyond.fit.offsets, scatter=beyond.fit.scatter, iterations=_LONG, patient=True,
        )  # fmt: skip
        self.tried += 1
        scored = Scored(model.names, again, cross_validated(again, self._fold, bounds))
        return min(model, scored, key=lambda one: one.total)

    def known(self, names: tuple[str, ...]) -> Scored | None:
        """Return the model with the effects `names` if it was fitted."""
        return self._known.get(tuple(sorted(names)))

    def _predictor(self, names: tuple[str, ...]) -> Predictor:
        return Predictor(self.batch, names)
