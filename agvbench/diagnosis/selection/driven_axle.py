"""The driven axle as a hypothesis, where no file declares it.

With one driven axle the vehicle moves at the speed of that axle. Under the assumption that both drive, its speed in
turns is wrong by a cosine of the steering angle, which no map absorbs, and which a loss of speed in turns may mimic.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import may_have_structure
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.effects import effect_kinds
from agvbench.effects.variants import cause_of
from agvbench.vehicle.geometry import Driven

UNDECLARED: Driven = "both"
"""The value in a file that declares no driven axle, which is also the declaration that both axles drive."""

_AXLES: tuple[Driven, ...] = get_args(Driven)


def better_driven_axle(selection: Selection, selector: Selector) -> Driven | None:
    """Return the axle that predicts clearly better as the only driven one, or None.

    The hypotheses are fitted if the residual of the selected model may have structure, or if it has an effect on the
    speed in turns. The models with one driven axle lack the effects that they may make unnecessary, so that they have
    fewer parameters. A vehicle file with such an effect declares that both axles drive.

    Two driven axles lie between the front and the rear one. If one axle alone drives the vehicle, the other one alone
    therefore predicts worse than both; if it does not, the residual has another cause.
    """
    chosen = selection.chosen
    if any(map(_is_of_turns, selector.given)):
        return None
    if not (any(map(_is_of_turns, chosen.names)) or may_have_structure(chosen, selector.seed)):
        return None
    deviances = {axle: _deviance_with(axle, chosen, selector) for axle in _AXLES if axle != UNDECLARED}
    best, other = sorted(deviances, key=lambda axle: deviances[axle])
    is_better = deviances[best] < chosen.deviance - SELECTION.min_gain
    return best if is_better and deviances[other] > chosen.deviance + SELECTION.min_gain else None


def _is_of_turns(name: str) -> bool:
    """Return whether an effect explains the speed in turns, or needs two driven axles."""
    kind = effect_kinds().get(cause_of(name))
    return cause_of(name) == "cornering_speed_loss" or (kind is not None and kind.needs_both_axles_driven)


def _deviance_with(axle: Driven, chosen: ScoredModel, selector: Selector) -> float:
    """Return the deviance of the chosen model with one driven `axle`, less the effects on the speed in turns.

    It is infinite where the fit diverges.
    """
    batch, own = chosen.fit.predictor.batch, chosen.fit.effect_values()
    names = tuple(name for name in chosen.names if not _is_of_turns(name))
    kept = [value for key, value in own.items() if key.partition(".")[0] in names]
    start = np.r_[chosen.fit.parameters[: batch.maps.size], kept]
    other = Batch(batch.readings, batch.maps, replace(batch.geometry, driven=axle), kinds=batch.kinds)
    try:
        return selector.for_batch(other).score(names, start, None).deviance
    except np.linalg.LinAlgError:
        return math.inf
