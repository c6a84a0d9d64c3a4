"""The driven axle as a hypothesis, where the campaign declares none.

With one driven axle the vehicle moves at the speed of that axle. Under the assumption that both drive, its speed in
turns is wrong by a cosine of the steering angle, which no map absorbs, and which a loss of speed in turns may mimic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.lack_of_fit import has_structure
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.effects import effect_kinds
from agvbench.effects.variants import cause_of
from agvbench.vehicle.geometry import Driven

UNDECLARED: Driven = "both"
"""What a header without a driven axle states; it cannot be distinguished from a declaration that both axles drive."""


def better_driven_axle(selection: Selection, selector: Selector, under: Callable[[Driven], Selector]) -> Driven | None:
    """Return the axle that predicts clearly better as the only driven one, or None.

    The hypotheses are compared if the selected model leaves structure or needs an effect on the speed in turns. The
    models with one driven axle lack the effects that they may make unnecessary, so that they have fewer parameters.

    Parameters
    ----------
    selection, selector
        The selection under the assumption that both axles drive.
    under
        Returns a selector of the same runs with one driven axle.
    """
    chosen = selection.chosen
    if not (_explains_turns(chosen) or has_structure(chosen, selector.seed)):
        return None
    models = {axle: _with_driven_axle(chosen, under(axle)) for axle in get_args(Driven) if axle != UNDECLARED}
    best: Driven = min(models, key=lambda axle: models[axle].deviance)
    return best if models[best].deviance < chosen.deviance - SELECTION.min_gain else None


def _explains_turns(model: ScoredModel) -> bool:
    return any(_is_of_turns(name) for name in model.names)


def _is_of_turns(name: str) -> bool:
    """Return whether an effect explains the speed in turns, or needs two driven axles."""
    cause = cause_of(name)
    return cause == "cornering_speed_loss" or (
        cause in effect_kinds() and effect_kinds()[cause].needs_both_axles_driven
    )


def _with_driven_axle(chosen: ScoredModel, selector: Selector) -> ScoredModel:
    """Return the chosen model with one driven axle, less the effects on the speed in turns."""
    own = chosen.fit.effect_values()
    names = tuple(name for name in chosen.names if not _is_of_turns(name))
    kept = [value for key, value in own.items() if key.partition(".")[0] in names]
    maps = chosen.fit.parameters[: selector.batch.maps.size]
    return selector.score(names, np.r_[maps, kept], None)
