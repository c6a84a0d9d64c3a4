"""Parameters that differ between recordings and drift: steering offset and gain, and the level of the drive.

A battery is charged, a linkage is knocked, another floor is driven on. The model of the selected effects has one value
of each for all recordings. A recording's own value is estimated from the residuals of the windows that ended before a
prediction begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from agvbench.diagnosis.criteria import VARYING
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.free_driving.parameter_filter import filter_parameters
from agvbench.diagnosis.free_driving.window_residuals import Quantity, VaryingModel, WindowResiduals
from agvbench.types import Floats

_SCALES = 4
_LEAST_VARIANCE = 1e-12
_WIDE = 2.0


@dataclass(frozen=True)
class Variation:
    """How much the m ``quantities`` vary: standard deviations (m,) between recordings, and within one, for seconds.

    ``drift_s``: time in which they drift as far as recordings differ. ``lack`` (4,): what the model lacks besides, in
    units of `WindowResiduals.scale`.
    """

    quantities: tuple[Quantity, ...]
    between: Floats
    within: Floats
    drift_s: float
    lack: Floats

    @classmethod
    def fitted(cls, model: VaryingModel, residuals: WindowResiduals, training: NDArray[np.bool_]) -> Variation:
        """Return the variation of maximum posterior density, given the residuals of the `training` windows (W,).

        Few recordings say little about how much recordings differ, and the maps absorb a part of that. The prior is
        therefore the one of `VaryingCriteria`: log-normal, about what servos, floors and batteries differ by.
        """
        used = training[residuals.order] & np.isfinite(residuals.residual).all(axis=1)
        offsets = np.array([not quantity.is_gain for quantity in model.quantities])
        between = np.where(offsets, VARYING.offset_rad, VARYING.gain)
        usual = _usual_lack(residuals, used)
        within, drift_s, time_error_s = VARYING.share_within * between, [VARYING.drift_s], [VARYING.time_error_s]
        mean = np.log(np.concatenate([between, within, drift_s, usual, time_error_s]))
        spread = np.repeat(
            [VARYING.spread_between, VARYING.spread_within, VARYING.spread_drift, _WIDE, VARYING.spread_time_error],
            [len(between), len(between), 1, len(usual), 1],
        )

        def loss(z: Floats) -> float:
            density = cls._of(model.quantities, mean + spread * z)._filtered(residuals)[1]
            return float(-np.sum(density[used]) + 0.5 * np.sum(z**2))

        found = minimize(loss, np.zeros(len(mean)), method="L-BFGS-B", bounds=[(-4.0, 4.0)] * len(mean))
        return cls._of(model.quantities, mean + spread * found.x)

    @classmethod
    def _of(cls, quantities: tuple[Quantity, ...], logarithms: Floats) -> Variation:
        values, m = np.exp(logarithms), len(quantities)
        return cls(quantities, values[:m], values[m : 2 * m], float(values[2 * m]), values[2 * m + 1 :])

    def estimates(self, residuals: WindowResiduals) -> tuple[Floats, Floats]:
        """Return the quantities at the beginning of each window and their standard errors, both (W, m)."""
        found = np.empty((len(residuals.order), 2, len(self.quantities)))
        found[residuals.order] = self._filtered(residuals)[0]
        return found[:, 0], found[:, 1]

    def _filtered(self, residuals: WindowResiduals) -> tuple[Floats, Floats]:
        """Return estimates with their standard errors (W, 2, m) and log predictive densities (W,), in the order."""
        count = len(residuals.order)
        variance = residuals.noise + np.sum((self.lack[:, None] * residuals.scale) ** 2, axis=1) + _LEAST_VARIANCE
        estimates, density = np.empty((count, 2, len(self.quantities))), np.empty(count)
        filter_parameters(
            residuals.restarts, residuals.begins_s, residuals.ends_s, residuals.residual, residuals.slopes, variance,
            self.between**2, self.within**2, np.array([self.drift_s, VARYING.within_s]), VARYING.ahead_s,
            estimates, density,
        )  # fmt: skip
        return estimates, density


def _usual_lack(residuals: WindowResiduals, used: NDArray[np.bool_]) -> Floats:
    """Return half of the median residual of the windows `used`, per distance along, across and in heading (3,)."""
    own = np.array([residuals.scale[used, a, a] for a in range(_SCALES - 1)]).T
    share = np.abs(residuals.residual[used]) / own
    return np.maximum(0.5 * np.median(share, axis=0) if len(share) else np.zeros(_SCALES - 1), _WIDE * 1e-4)


def varied_poses(model: VaryingModel, variation: Variation, residuals: WindowResiduals) -> Floats:
    """Return the poses (W, K, 3) that a model predicts with what earlier windows of each recording say."""
    return model.poses(variation.estimates(residuals)[0])


def by_recording(
    model: VaryingModel, variation: Variation, residuals: WindowResiduals
) -> dict[str, dict[str, dict[str, float]]]:
    """Return for each recording the quantities and their standard errors at its last window."""
    values, stderr = variation.estimates(residuals)
    recording, order = _initial_states(model.predictor.readings).recording, residuals.order.tolist()
    last = {str(recording[i]): i for i in order}
    return {
        name: {
            quantity: {"value": float(values[i, k]), "stderr": float(stderr[i, k])}
            for k, quantity in enumerate(model.names)
        }
        for name, i in last.items()
    }
