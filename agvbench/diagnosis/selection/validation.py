"""The validation gate: effects that predict the validation runs worse than the maps alone are rejected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.residuals.residuals import (
    AT_THE_FLOOR,
    LACK_OF_FIT,
    EndSpread,
    Misses,
    end_spread,
    floor,
    lack_of_fit,
    misses,
)
from agvbench.diagnosis.selection.fitted_models import Scored
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.variants import BEYOND
from agvbench.diagnosis.selection.with_term import Explained
from agvbench.effects.forms import effect_forms
from agvbench.types import Floats


@dataclass(frozen=True)
class Judged:
    """What was missed ``before`` and ``after``, the ``floor`` by quantity, and the p-value of ``lack_of_fit``."""

    before: Misses
    after: Misses
    floor: dict[str, float]
    lack_of_fit: float | None

    @property
    def lacks(self) -> bool:
        """Whether more is missed than repeats scatter, and other than by chance."""
        after = self.after.rms()
        above = any(after[name] > AT_THE_FLOOR * self.floor[name] for name in ("position_rms_mm", "heading_rms_deg"))
        return above and self.lack_of_fit is not None and self.lack_of_fit < LACK_OF_FIT


def judge(
    readings: Readings, held: NDArray[np.bool_], before: Floats, after: Floats, spread: EndSpread
) -> Judged | None:
    """Return how poses (R, K, 3) predicted ``before`` and ``after`` miss the runs `held` (R,); None without repeats."""
    kept = readings.select(held)
    missed = misses(kept, after[held])
    least = floor(missed, kept.group) or floor(misses(readings, after), readings.group)
    if least is None:
        return None
    return Judged(misses(kept, before[held]), missed, least, lack_of_fit(missed, kept.group, spread.select(held)))


def predicts(selection: Selection, explained: Explained | None, readings: Readings) -> Predictor:
    """Return what predicts `readings` with the effects that were chosen, and the term if there is one."""
    chosen = (explained.selection if explained else selection).chosen
    fitted = chosen.fit.predictor.batch
    reformed = bool(effect_forms().keys() & set(chosen.names))
    batch = Batch(readings, fitted.maps, fitted.geometry, kinds=BEYOND if explained or reformed else ())
    return Predictor(batch, chosen.names)


def contradicts(selection: Selection, readings: Readings, held: NDArray[np.bool_]) -> bool:
    """Whether the runs `held` (R,) miss what was chosen by more than their scatter; no runs do not."""
    if not held.any():
        return False
    kept = readings.select(held)
    judged = _judged(selection, kept, np.ones(len(kept), dtype=np.bool_)) or _judged(selection, readings, held)
    return judged is not None and judged.lacks


def _judged(selection: Selection, readings: Readings, held: NDArray[np.bool_]) -> Judged | None:
    fit = selection.chosen.fit
    every = predicts(selection, None, readings)
    poses = every.predict(fit.parameters)
    return judge(readings, held, poses, poses, end_spread(every, fit))


def withdrawn(
    selection: Selection, explained: Explained | None, kept: Readings, tell: Callable[[str], None]
) -> tuple[Selection, Explained | None]:
    """Return what was found, or the maps alone where they predict the validation runs better.

    Cross-validation asks the runs that were fitted, and may be led astray by all of them together. A cause at work
    improves what nobody looked at, too.

    Parameters
    ----------
    selection, explained
        What was found.
    kept
        The validation runs; without any, what was found is kept.
    tell
        Called with a line if it is withdrawn.
    """
    chosen = explained.selection.chosen if explained else selection.chosen
    if chosen.names == selection.base.names or not len(kept):
        return selection, explained
    fitted = chosen.fit.predictor.batch
    batch = Batch(kept, fitted.maps, fitted.geometry, kinds=fitted.kinds)
    if _missed(chosen, batch) <= _missed(selection.base, batch):
        return selection, explained
    tell(f"{' + '.join(chosen.names)}: withdrawn, for the validation runs are predicted better without")
    rejected = selection.rejected | selection.gains
    return replace(selection, chosen=selection.base, rivals={}, gains={}, rejected=rejected), None


def _missed(model: Scored, batch: Batch) -> float:
    """Return the mean square of the position that a model misses of the runs of `batch` [m²]."""
    poses = Predictor(batch, model.fit.predictor.effects).predict(model.fit.parameters)
    return float(np.mean(misses(batch.readings, poses).squares()["position_rms_mm"]))
