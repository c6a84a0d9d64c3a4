"""The validation gate: effects that predict the validation runs worse than the maps alone are rejected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.residuals.repeatability import repeatability, reproducibility
from agvbench.diagnosis.residuals.residuals import EndCovariance, PoseResiduals, lack_of_fit, pose_residuals
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import EXTENDED_LIBRARY
from agvbench.diagnosis.selection.with_term import TermSelection
from agvbench.effects.variants import effect_variants
from agvbench.types import Floats


@dataclass(frozen=True)
class Assessment:
    """Residuals ``before`` and ``after``, the spread of repeats by quantity, and the p-value of ``lack_of_fit``.

    ``repeatability`` is that of repeats in succession, ``reproducibility`` that of all repeats of the campaign.
    """

    before: PoseResiduals
    after: PoseResiduals
    repeatability: dict[str, float]
    reproducibility: dict[str, float]
    lack_of_fit: float | None

    @property
    def has_lack_of_fit(self) -> bool:
        """Whether the residuals exceed the repeatability, and the lack of fit is significant."""
        after = self.after.rms()
        above = any(
            after[name] > RESIDUAL.within_repeatability * self.repeatability[name]
            for name in ("position_rms_mm", "heading_rms_deg")
        )
        return above and self.lack_of_fit is not None and self.lack_of_fit < RESIDUAL.lack_of_fit_alpha


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
    return Assessment(pose_residuals(kept, before[held]), residuals, *spread, p_value)


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
    """Return the selection, or the maps alone if these predict the validation runs better.

    Cross-validation uses the training runs, and a bias that they share may mislead it. A real cause improves the
    prediction of unseen runs, too.

    Parameters
    ----------
    selection, term_selection
        The selection, and the one with a discrepancy term if there is one.
    kept
        The validation runs; without any, the selection is returned.
    on_progress
        Called with a line if the selection is rejected.
    """
    chosen = term_selection.selection.chosen if term_selection else selection.chosen
    if chosen.names == selection.base.names or not len(kept):
        return selection, term_selection
    fitted = chosen.fit.predictor.batch
    batch = Batch(kept, fitted.maps, fitted.geometry, kinds=fitted.kinds)
    if _mean_square(chosen, batch) <= _mean_square(selection.base, batch):
        return selection, term_selection
    on_progress(f"{' + '.join(chosen.names)}: rejected in validation: the validation runs are predicted better without")
    rejected = selection.rejected | selection.gains
    return replace(selection, chosen=selection.base, alternatives={}, gains={}, rejected=rejected), None


def _mean_square(model: ScoredModel, batch: Batch) -> float:
    """Return the mean square of a model's position residuals in the runs of `batch` [m²]."""
    poses = Predictor(batch, model.fit.predictor.effects).predict(model.fit.parameters)
    return float(np.mean(pose_residuals(batch.readings, poses).squares()["position_rms_mm"]))
