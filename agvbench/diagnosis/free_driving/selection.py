"""Choosing effects for free driving: what is learnt in one way of driving must not be trusted in quite another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selector
from agvbench.types import Floats

_SEEN_QUANTILE = 0.98


@dataclass
class WindowSelector(Selector):
    """Tries effects on windows; see `Selector`.

    ``elsewhere`` holds the test windows. Only their commands and initial states are used, to see how far an effect
    would reach: one that moves the usual window there by more than nearly every window that it was fitted to
    extrapolates, and is rejected. ``extrapolating`` names those that were rejected for that.
    """

    # Fast stretches may be few: only the single best stretch is left out to see whether others gain, too.
    excluded_share: ClassVar[float] = 0.0
    # Residuals of windows are mostly systematic, so that a small part of them is no cause of its own.
    min_relative_change: ClassVar[float] = 0.3
    elsewhere: Batch | None = None
    extrapolating: set[str] = field(default_factory=set)

    def meets_criterion(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        """Whether the larger model predicts better by enough, and where it was tried is where it is used."""
        if not super().meets_criterion(without, with_it):
            return False
        added = set(with_it.names) - set(without.names)
        if self._extrapolates(without, with_it):
            self.extrapolating |= added
            return False
        self.extrapolating -= added
        return True

    def _extrapolates(self, without: ScoredModel, with_it: ScoredModel) -> bool:
        if self.elsewhere is None:
            return False
        learnt, used = (self._moved(batch, without, with_it) for batch in (self.batch, self.elsewhere))
        return bool(np.median(used) > np.quantile(learnt, _SEEN_QUANTILE))

    @staticmethod
    def _moved(batch: Batch, without: ScoredModel, with_it: ScoredModel) -> Floats:
        """Return how far apart both models predict each window to end (W,) [m]."""
        small, large = (Predictor(batch, m.fit.predictor.effects).predict(m.fit.parameters) for m in (without, with_it))
        return np.asarray(np.hypot(*(large - small)[:, -1, :2].T))
