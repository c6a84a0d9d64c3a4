"""The validation gate: effects that predict the validation runs worse than the maps alone are rejected."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import folds
from agvbench.diagnosis.estimation.levenberg_marquardt import FitState, LevenbergMarquardt
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.residuals.bias_test import bias_p_value
from agvbench.diagnosis.residuals.repeatability import repeatability, reproducibility
from agvbench.diagnosis.residuals.residuals import (
    EndCovariance,
    PoseResiduals,
    group_means,
    lack_of_fit,
    pose_residuals,
)
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.selection.with_term import TermSelection
from agvbench.effects.variants import effect_variants
from agvbench.types import Floats

_EXACT_M2 = 1e-12
"""A simulator without noise may be predicted exactly, and an error of zero has no logarithm."""
_REJECTED = "{}: rejected in validation: the validation runs are predicted better without"


@dataclass(frozen=True)
class Assessment:
    """Residuals ``before`` and ``after``, the spread of repeats by quantity, and p-values.

    ``repeatability`` is that of repeats in succession, ``reproducibility`` that of all repeats of the campaign.
    ``lack_of_fit`` is the p-value of the lack-of-fit test, and ``bias`` that of repeats that miss to the same side.
    """

    before: PoseResiduals
    after: PoseResiduals
    repeatability: dict[str, float]
    reproducibility: dict[str, float]
    lack_of_fit: float | None
    bias: float | None = None

    @property
    def has_lack_of_fit(self) -> bool:
        """Whether the residuals exceed the repeatability significantly, or far and to the same side in repeats."""
        tests = (self.lack_of_fit, RESIDUAL.within_repeatability), (self.bias, RESIDUAL.far_beyond_repeatability)
        return any(
            p_value is not None
            and p_value < RESIDUAL.lack_of_fit_alpha
            and self.after.exceed(self.repeatability, multiple)
            for p_value, multiple in tests
        )


def assess(
    readings: Readings,
    held: NDArray[np.bool_],
    before: Floats,
    after: Floats,
    covariance: EndCovariance,
    repeats: NDArray[np.bool_] | None = None,
) -> Assessment | None:
    """Assess predicted poses (R, K, 3) ``before`` and ``after`` in the runs `held` (R,); return None without repeats.

    The lack of fit is tested against the deviations between the runs `repeats` (R,), which include `held`; by default
    they are `held`.
    """
    kept = readings.select(held)
    residuals = pose_residuals(kept, after[held])
    spread = _spread_of_repeats(kept, residuals) or _spread_of_repeats(readings, pose_residuals(readings, after))
    if spread is None:
        return None
    among = held if repeats is None else repeats
    repeated = readings.select(among)
    p_value = lack_of_fit(pose_residuals(repeated, after[among]), repeated.group, covariance.select(among), held[among])
    bias = bias_p_value(residuals.ends[:, :2], kept.group)
    return Assessment(pose_residuals(kept, before[held]), residuals, *spread, p_value, bias)


def _spread_of_repeats(
    readings: Readings, residuals: PoseResiduals
) -> tuple[dict[str, float], dict[str, float]] | None:
    """Return repeatability and reproducibility; the former has the value of the latter if no session has repeats."""
    every = reproducibility(residuals, readings.group)
    if every is None:
        return None
    return repeatability(residuals, readings.session_group, readings.started_h) or every, every


def predictor_for(selection: Selection, term_selection: TermSelection | None, readings: Readings) -> Predictor:
    """Return the predictor of `readings` with the selected effects, and the discrepancy term if there is one."""
    chosen = (term_selection.selection if term_selection else selection).chosen
    fitted = chosen.fit.predictor.batch
    has_variants = bool(effect_variants().keys() & set(chosen.names))
    batch = Batch(
        readings, fitted.maps, fitted.geometry, kinds=EXTENDED_LIBRARY if term_selection or has_variants else ()
    )
    return Predictor(batch, chosen.names)


def validated(
    selection: Selection, term_selection: TermSelection | None, kept: Readings, on_progress: Callable[[str], None]
) -> tuple[Selection, TermSelection | None]:
    """Return the selection, or less of it if that predicts the validation runs better.

    Cross-validation uses the training runs, and a bias that they share may mislead it. A real cause improves the
    prediction of unseen runs, too. Less of the selection is the effects without the discrepancy term, then the maps
    alone.

    Parameters
    ----------
    selection, term_selection
        The selection, and the one with a discrepancy term if there is one.
    kept
        The validation runs; without any, the selection is returned.
    on_progress
        Called with a line if the selection is rejected.
    """
    if term_selection is not None and not predicts(term_selection.selection.chosen, selection.base, kept):
        on_progress(_REJECTED.format(" + ".join(term_selection.selection.chosen.names)))
        term_selection = None
    if term_selection is not None or predicts(selection.chosen, selection.base, kept):
        return selection, term_selection
    on_progress(_REJECTED.format(" + ".join(selection.chosen.names)))
    return without_effects(selection), None


def without_effects(selection: Selection) -> Selection:
    """Return the selection of the maps alone, with its effects among the rejected ones."""
    rejected = selection.rejected | selection.gains
    return replace(selection, chosen=selection.base, alternatives={}, gains={}, rejected=rejected)


def predicts(chosen: ScoredModel, base: ScoredModel, kept: Readings) -> bool:
    """Return whether `chosen` predicts the runs `kept` no worse than `base`.

    Its squared position errors are no larger, or they are larger by no more than chance and the deviance is no larger:
    most of the error may be the difference between repeats, which no model predicts, and the deviance allows for it.
    """
    if chosen.names == base.names or not len(kept):
        return True
    fitted = chosen.fit.predictor.batch
    under = replace(kept, preset=fitted.readings.preset)
    batch = Batch(under, fitted.maps, fitted.geometry, kinds=fitted.kinds)
    (own, square), (without, square_without) = _in_batch(chosen, batch), _in_batch(base, batch)
    if math.isinf(own) or math.isinf(without):
        return own <= without
    worse, chance = _difference(square, square_without)
    return worse <= 0.0 or (own <= without and worse <= chance)


def predicts_left_out(chosen: ScoredModel, base: ScoredModel, selector: Selector) -> bool:
    """Return whether `chosen` predicts runs that are left out better than `base`.

    A third of the groups is left out at a time, and both models are fitted anew to the others. Here are enough runs to
    require a gain.
    """
    if chosen.names == base.names:
        return True
    batch, count = selector.batch, RESIDUAL.left_out_folds
    fold = folds(batch.readings.group, count, selector.seed)
    if np.ptp(fold) == 0:
        return True  # one group: nothing can be left out
    deviance, square = np.zeros(2), np.empty((2, len(fold)))
    for k in np.unique(fold):
        others, own = (
            Batch(batch.readings.select(runs), batch.maps, batch.geometry, kinds=batch.kinds)
            for runs in (fold != k, fold == k)
        )
        fitting = selector.for_batch(others)
        for i, model in enumerate((chosen, base)):
            loss, square[i, fold == k] = _in_batch(fitting.refitted(model), own)
            deviance[i] += loss
    if np.isinf(deviance).any():
        return bool(deviance[0] <= deviance[1])
    _, index = np.unique(batch.readings.group, return_inverse=True)
    errors = group_means(square.T, index).T
    return _is_better((deviance[0], errors[0]), (deviance[1], errors[1]))


def _is_better(own: tuple[float, Floats], base: tuple[float, Floats]) -> bool:
    """Return whether squared position errors by group (G,) are smaller, for models with a deviance each.

    Their means differ by more than chance. Within chance, both their means and, by more than chance, their geometric
    means agree: a few groups with large errors must not decide for all others. Otherwise the deviances decide.
    """
    worse, chance = _difference(own[1], base[1])
    if abs(worse) > chance:
        return worse < 0.0
    typical, chance = _difference(*(np.log(np.maximum(square, _EXACT_M2)) for square in (own[1], base[1])))
    if abs(typical) > chance and typical * worse >= 0.0:
        return typical < 0.0
    return own[0] <= base[0]


def _difference(own: Floats, base: Floats) -> tuple[float, float]:
    """Return by how much values (n,) exceed others in the mean, and by how much they may by chance."""
    worse = own - base
    chance = RESIDUAL.validation_standard_errors * np.std(worse) / np.sqrt(max(len(worse) - 1, 1))
    return float(np.mean(worse)), float(chance)


def _in_batch(model: ScoredModel | None, batch: Batch) -> tuple[float, Floats]:
    """Return a model's deviance in the runs of `batch`, and its mean squared position error in each (R,) [m²].

    Both are infinite where there is no model, because its fit diverged, and where it cannot be evaluated.
    """
    if model is not None:
        predictor, own = Predictor(batch, model.fit.predictor.effects), model.fit
        still = np.zeros((len(batch.readings), own.random_effects.shape[1]))
        state = FitState(own.parameters, still, own.variance_components)
        with suppress(np.linalg.LinAlgError):
            loss = LevenbergMarquardt(predictor, np.empty((0, 2))).evaluate(state).terms.loss.sum()
            residuals = pose_residuals(batch.readings, predictor.predict(own.parameters))
            return float(loss), residuals.squares()["position_rms_mm"]
    return math.inf, np.full(len(batch.readings), math.inf)
