"""Lags that only mimic a drive or a steering that varies.

A window begins with the measured speed and yaw rate. A long lag lets them last, and so predicts better where the speed
of a command changes slowly for a reason that the model lacks, such as a supply voltage. The filter of parameters that
vary describes such changes without a lag.
"""

from __future__ import annotations

import numpy as np

from agvbench.diagnosis.free_driving.selection import LAGS, WindowSelector
from agvbench.diagnosis.free_driving.varying_model import VaryingModel
from agvbench.diagnosis.free_driving.varying_parameters import log_density_with_variation
from agvbench.diagnosis.free_driving.window_residuals import WindowResiduals
from agvbench.diagnosis.selection.actuators import ACTUATORS
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.effects.variants import cause_of

_MIMICKING = LAGS | {"steering_lag"}


def without_mimicking_lags(selection: Selection, selector: WindowSelector) -> Selection:
    """Return the selection without the lags that predict worse than parameters that vary.

    The deviance of the model without the lag must be smaller by as much as an effect must gain, where both vary.
    """
    lags = [name for name in selection.gains if cause_of(name) in _MIMICKING]
    if not lags:
        return selection
    deviance = _deviance(selection.chosen)
    smaller = [selector.without_effect(selection.base, selection.chosen, name) for name in lags]
    gains = [deviance - _deviance(model) for model in smaller]
    best = int(np.argmax(gains))
    if gains[best] < selector.min_gain:
        return selection
    selector.on_progress(f"{lags[best]} predicts worse than parameters that vary: {gains[best]:.0f}")
    chosen, left = selector.backward_elimination(selection.base, smaller[best], ACTUATORS)
    rejected = selection.rejected | {cause_of(n): gain for n, gain in selection.gains.items() if n not in left}
    without = Selection(selection.base, chosen, {}, left, rejected, selector.models_fitted)
    return without_mimicking_lags(without, selector)


def _deviance(model: ScoredModel) -> float:
    """Return minus two log posterior density of a model whose steering and drive vary, in its windows."""
    batch = model.fit.predictor.batch
    varying = VaryingModel.of(model.fit, batch)
    every = np.ones(len(batch.readings), dtype=np.bool_)
    return -2.0 * log_density_with_variation(varying, WindowResiduals.of(varying), every)
