"""Which effects the model needs, and which others would do as well."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from agvbench.diagnosis.estimation.cross_validation import differs_from_null, without_best_groups
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.residuals import pose_residuals
from agvbench.diagnosis.selection.fitted_models import FittedModels, ScoredModel

LEAST_GAIN = 12.0
"""Selection criterion: the least cross-validated gain in minus two log likelihood, before the correction for having
tried many: each effect tried adds as if its gain came from one of so many."""

ALTERNATIVE_MARGIN = 10.0
"""An effect that predicts this much worse, or less, in place of a named one is an indistinguishable alternative."""

NOTICEABLE = 0.15
"""An effect has to move the prediction by this part of what remains unpredicted, be it ever so certain."""

_NEARLY_ALTERNATIVE = 100.0  # an alternative may look so much worse because its fit ended sooner
_MOST_EFFECTS = 4


@dataclass(frozen=True)
class Selection:
    """What was chosen.

    ``base`` is the model without effects, ``chosen`` the one with all that meet the selection criterion;
    ``alternatives`` by named effect the others that would do in its place, with how much worse they predict;
    ``gains`` by named effect what its removal would cost; ``tried`` how many models were fitted, ``rejected`` the gain
    of each effect that does not meet the criterion.
    """

    base: ScoredModel
    chosen: ScoredModel
    alternatives: dict[str, dict[str, float]]
    gains: dict[str, float]
    rejected: dict[str, float]
    tried: int


@dataclass
class Selector(FittedModels):
    """Tries effects on the runs to be fitted, and decides which meet the selection criterion.

    ``wide`` keeps a batch with more than the library, once one was needed.
    """

    best_share: ClassVar[float] = 0.05
    noticeable: ClassVar[float] = NOTICEABLE
    wide: Batch | None = field(init=False, default=None)

    @property
    def least_gain(self) -> float:
        """What an effect must gain, corrected for the number of effects that are tried for each place."""
        return LEAST_GAIN + 2.0 * math.log(max(len(self.candidates), 1))

    def over(self, batch: Batch) -> Selector:
        """Return a selector like this one of other runs, which knows nothing yet."""
        return Selector(
            batch, dict(self.candidates), self.start, self.seed, self.on_progress, self.given, self.given_values
        )

    def select(self) -> Selection:
        """Add effects until none gains, then drop those without which the model predicts as well."""
        base = current = self.base()
        rejected: dict[str, float] = {}
        while len(current.names) < len(self.given) + _MOST_EFFECTS:
            offers = {name: self.with_effect(current, name) for name in self.candidates if name not in current.names}
            rejected = {name: offer.gain_over(current) for name, offer in offers.items()}
            worthy = {name: offer for name, offer in offers.items() if self.meets_criterion(current, offer)}
            if not worthy:
                break
            current = min(worthy.values(), key=lambda offer: offer.total)
            self.on_progress(f"{' + '.join(current.names)}: gains {base.total - current.total:.0f}")
        current, gains = self.backward_elimination(base, current)
        current, alternatives = self.with_swaps(base, current)
        if set(current.names) != set(gains) | set(self.given):
            current, gains = self.backward_elimination(base, current)
            alternatives = {name: others for name, others in alternatives.items() if name in gains}
        rejected = {name: gain for name, gain in rejected.items() if name not in current.names}
        return Selection(base, current, alternatives, gains, rejected, self.tried)

    def meets_criterion(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        """Whether the larger model predicts better by enough, not in a few groups of runs alone, and to be noticed."""
        gain = without.loss - with_it.loss
        return bool(
            with_it.gain_over(without) > self.least_gain
            and without_best_groups(gain, self.batch.readings.group, self.best_share) > 0.0
            and self._noticeable(without, with_it)
            and all(
                differs_from_null(with_it.fit, name, self.batch.readings.group)
                for name in set(with_it.names) - set(without.names)
            )
        )

    def _noticeable(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        """Whether the prediction moves by a noticeable part of the larger model's residuals."""
        readings = self.batch.readings
        small, large = (model.fit.predictor.predict(model.fit.parameters) for model in (without, with_it))
        residuals = pose_residuals(readings, large).squares()
        moved = pose_residuals(
            replace(readings, poses=np.where(readings.seen[..., None], small, np.nan)), large
        ).squares()
        return any(
            float(np.mean(moved[name])) > self.noticeable**2 * float(np.mean(residuals[name]))
            for name in ("position_rms_mm", "heading_rms_deg")
        )

    def _found(self, current: ScoredModel) -> tuple[str, ...]:
        return tuple(name for name in current.names if name not in self.given)

    def backward_elimination(self, base: ScoredModel, current: ScoredModel) -> tuple[ScoredModel, dict[str, float]]:
        """Return the model with only the effects that meet the criterion, and what the loss of each would cost."""
        while found := self._found(current):
            smaller = {name: self.without_effect(base, current, name) for name in found}
            gains = {name: model.total - current.total for name, model in smaller.items()}
            useless = [name for name, model in smaller.items() if not self.meets_criterion(model, current)]
            if not useless:
                return current, gains
            current = self.left(smaller[min(useless, key=lambda name: gains[name])], current)
        return current, {}

    def with_swaps(
        self, base: ScoredModel, current: ScoredModel, among: Mapping[str, Iterable[str]] | None = None
    ) -> tuple[ScoredModel, dict[str, dict[str, float]]]:
        """Return the model with effects replaced by others that predict better, and the alternatives left.

        What was chosen first was chosen in the place of all the others, too, and may only look like one of them.

        Parameters
        ----------
        base, current
            The model without effects, and the one to judge.
        among
            By effect, which others are tried in its place; by default every candidate.
        """
        for _ in range(_MOST_EFFECTS):
            swapped = {name: self._in_place_of(name, base, current, among) for name in self._found(current)}
            better = [
                offer
                for name, offers in swapped.items()
                for offer in offers.values()
                if offer.gain_over(current) > LEAST_GAIN
                and self.meets_criterion(self.without_effect(base, current, name), offer)
            ]
            if not better:
                break
            best = min(better, key=lambda offer: offer.total)
            self.on_progress(f"{' + '.join(best.names)} in place of {' + '.join(current.names)}")
            current = best
        return current, self._alternatives(swapped, current)

    def _in_place_of(
        self, name: str, base: ScoredModel, current: ScoredModel, among: Mapping[str, Iterable[str]] | None
    ) -> dict[str, ScoredModel]:
        """Return, by its name, what each other effect makes of the model in the place of the one called `name`."""
        tried = self.candidates if among is None else among.get(name, ())
        return {
            other: self.with_effect(self.without_effect(base, current, name), other)
            for other in tried
            if other not in current.names
        }

    def _alternatives(
        self, swapped: dict[str, dict[str, ScoredModel]], current: ScoredModel
    ) -> dict[str, dict[str, float]]:
        """Return, by named effect, those that predict nearly as well in its place, and by how much worse they do."""
        worse = {n: {o: self._worse(offer, current) for o, offer in offers.items()} for n, offers in swapped.items()}
        alternatives = {n: {o: w for o, w in others.items() if w < ALTERNATIVE_MARGIN} for n, others in worse.items()}
        return {name: others for name, others in alternatives.items() if name in current.names}

    def _worse(self, offer: ScoredModel, current: ScoredModel) -> float:
        """Return by how much another effect predicts worse, its fit carried on from where the chosen one stands."""
        worse = offer.total - current.total
        if ALTERNATIVE_MARGIN <= worse < _NEARLY_ALTERNATIVE and offer.is_fitted:
            worse = self.refitted_from(offer, current).total - current.total
        return worse
