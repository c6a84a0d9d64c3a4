"""What validation or test runs say of a model: how far it misses them, beside how far they scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.batch import Batch
from agvbench.diagnosis.explained import Explained
from agvbench.diagnosis.forms import BEYOND
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.reading import Readings
from agvbench.diagnosis.residual_spread import EndSpread, end_spread
from agvbench.diagnosis.residuals import AT_THE_FLOOR, LACK_OF_FIT, Misses, floor, lack_of_fit, misses
from agvbench.diagnosis.selection import Selection
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
