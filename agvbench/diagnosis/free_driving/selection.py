"""Selection of effects for free driving, without extrapolation to other driving."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from agvbench.diagnosis.criteria import FREE_DRIVING, VARIANT, SelectionCriteria
from agvbench.diagnosis.discrepancy.stepwise import TERM_NAMES
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.actuators import ACTUATORS, CAMERA, SERVOS_DELAY
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import (
    add_variants,
    select_variants,
    simulated_variants,
    with_extended_library,
)
from agvbench.effects.variants import cause_of, effect_variants
from agvbench.types import Floats

_EXTRAPOLATION_QUANTILE = 0.98

LAGS = frozenset({"speed_lag", "wheel_lag"})
_MOST_PARAMETERS = 3
DRIVES = frozenset(
    name
    for name, kind in effect_variants().items()
    if kind.variant_of in LAGS and len(kind.parameters()) <= _MOST_PARAMETERS
)
"""Variants of how a drive follows its command: limited acceleration, coasting, a controller that overshoots. Those with
more parameters describe how a drive starts from rest."""


@dataclass
class WindowSelector(Selector):
    """Selects effects by windows; see `Selector`.

    ``test_batch`` holds the test windows, of which only commands and initial states are used. An effect extrapolates if
    its median change of the test windows is larger than its change of 98 % of the training windows. Such effects are
    rejected; ``extrapolating`` names them. Only variants of the drive and a delay of each channel are tried: a
    simulation with every variant takes three times as long. Alternatives are computed once, for the final model.
    """

    criteria: ClassVar[SelectionCriteria] = FREE_DRIVING
    further_kinds: ClassVar[frozenset[str] | None] = frozenset({SERVOS_DELAY, *DRIVES})
    finds_alternatives: ClassVar[bool] = False
    always_fitted: ClassVar[frozenset[str]] = frozenset(ACTUATORS)
    test_batch: Batch | None = None
    extrapolating: set[str] = field(default_factory=set)

    def max_loss_of_likely(self, current: ScoredModel) -> float:
        """Return a loss that is not much larger than that of `current`: windows have no random effects."""
        return current.fit.total_loss + VARIANT.max_fit_loss

    def max_loss_of_further(self, current: ScoredModel, name: str) -> float:
        """Return the loss with the least gain of an effect: what gains less in fit is not selected."""
        return math.inf if cause_of(name) in self.always_fitted else current.fit.total_loss - self.min_gain

    def with_alternatives(self, selection: Selection) -> Selection:
        """Return a selection with the alternatives of its effects."""
        alternatives = self.alternatives(selection.base, selection.chosen)
        return replace(selection, alternatives=alternatives, tried=self.models_fitted)

    def for_batch(self, batch: Batch) -> Self:
        """Return a selector with the same candidates and test windows for another batch, with an empty cache."""
        test = self.test_batch
        if test is not None:
            test = test.repacked(kinds=batch.kinds, preset=batch.readings.preset)
        return replace(super().for_batch(batch), test_batch=test)

    def preferred(self, models: list[ScoredModel]) -> ScoredModel:
        """Return the model of least deviance, without a latency of the camera if another predicts as well."""
        best = super().preferred(models)
        others = [model for model in models if CAMERA not in model.names and best.is_matched_by(model)]
        return super().preferred(others) if others and CAMERA in best.names else best

    def improves(self, without: ScoredModel, with_it: ScoredModel, *, of_group: bool = False) -> bool:
        """Return whether the added effects improve the prediction, are within their bounds and do not extrapolate."""
        if not super().improves(without, with_it, of_group=of_group):
            return False
        added = set(with_it.names) - set(without.names)
        if any(with_it.is_at_bound(name) or _is_term_at_bound(with_it, name) for name in added):
            return False
        if self._extrapolates(without, with_it):
            self.extrapolating |= added
            return False
        self.extrapolating -= added
        return True

    def _extrapolates(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        if self.test_batch is None:
            return False
        training, test = (self._moved(batch, without, with_it) for batch in (self.batch, self.test_batch))
        return bool(np.median(test) > np.quantile(training, _EXTRAPOLATION_QUANTILE))

    @staticmethod
    def _moved(batch: Batch, without: ScoredModel, with_it: ScoredModel) -> Floats:
        """Return the distance between the end positions that both models predict for each window (W,) [m]."""
        small, large = (Predictor(batch, m.fit.predictor.effects).predict(m.fit.parameters) for m in (without, with_it))
        return np.asarray(np.hypot(*(large - small)[:, -1, :2].T))


def _is_term_at_bound(model: ScoredModel, name: str) -> bool:
    return name in TERM_NAMES and bool(model.parameters_at_bound(name))


def select_drive(selection: Selection, selector: WindowSelector) -> tuple[Selection, WindowSelector]:
    """Return the selection with another equation of the drive, if one predicts better, and its selector.

    A variant takes the place of a selected effect. Beside a selection without a lag of the drive it is added: a delay
    of the drive resembles a limited acceleration, and leaves no gain to a lag of first order.
    """
    with_variants = select_variants(selection, selector, ACTUATORS, DRIVES)
    extended = with_extended_library(selector)
    chosen = with_variants.chosen
    if not LAGS & {cause_of(name) for name in chosen.names}:
        drives = (kind.name for kind in simulated_variants(extended.batch) if kind.name in DRIVES)
        tried = (extended.with_effect(chosen, name) for name in drives)
        better = [model for model in tried if model.is_fitted and extended.improves(chosen, model)]
        # One equation may contain another, and predict the same with a parameter more.
        chosen = min(better, key=lambda model: model.deviance + 2.0 * len(model.fit.parameters), default=chosen)
    if {*chosen.names} == {*selection.chosen.names}:
        return selection, selector
    add_variants(extended, chosen.names)
    return extended.select(chosen, ACTUATORS), extended
