"""Parameters that differ between recordings and drift: steering offset and gain, drive level, clock and rigid body.

A battery is charged, a linkage is knocked, another floor is driven on, the clocks of camera and vehicle differ, the
rigid body of the markers is defined anew. The model of the selected effects has one value of each for all recordings. A
recording's own value is estimated from the residuals of the windows that ended before a prediction begins. So are the
nodal values of maps at commands that the training windows hardly have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from agvbench.diagnosis.criteria import VARYING
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.free_driving.parameter_filter import filter_parameters
from agvbench.diagnosis.free_driving.varying_model import VaryingModel
from agvbench.diagnosis.free_driving.window_residuals import WindowResiduals
from agvbench.types import Floats

_OWN_SCALES = 3
_LEAST_VARIANCE = 1e-12
_WIDE = 2.0
_TYPICAL = {"rad": VARYING.offset_rad, "per_m": VARYING.offset_per_m, "s": VARYING.offset_s, "": VARYING.gain}


@dataclass(frozen=True)
class Variation:
    """How much m quantities vary: standard deviations (m,) between recordings, and (f,) of the first f for seconds.

    ``drift_s``: time in which they drift as far as recordings differ. ``lack`` (5,): what the model lacks besides, in
    units of `WindowResiduals.scale`; ``lack_alone`` (5,): what it lacks if nothing varies.
    """

    between: Floats
    within: Floats
    drift_s: float
    lack: Floats
    lack_alone: Floats

    @classmethod
    def fitted(cls, model: VaryingModel, residuals: WindowResiduals, training: NDArray[np.bool_]) -> Variation:
        """Return the variation of maximum posterior density, given the residuals of the `training` windows (W,)."""
        evidence = _Evidence.of(model, residuals, training)
        return cls(*evidence.parts(evidence.most_likely()[0]), evidence.most_likely_lack_alone())

    def estimates(self, residuals: WindowResiduals) -> tuple[Floats, Floats]:
        """Return quantities and map components at the beginning of each window, and their standard errors, (W, m + r).

        They are means over two hypotheses: that the recording varies, and that it does not. Before the recording both
        are equally probable; its windows decide (Bayesian model averaging).
        """
        values, density = _filtered(residuals, self.between, self.within, self.drift_s, self.lack)
        nothing = np.zeros_like(self.between), np.zeros_like(self.within)
        alone = _filtered(residuals.by_first(len(self.between)), *nothing, self.drift_s, self.lack_alone)[1]
        share = _probability(residuals, density - alone)[:, None]
        value, stderr = values[:, 0], values[:, 1]
        found = np.empty((2, *value.shape))
        found[:, residuals.order] = share * value, np.sqrt(share * stderr**2 + share * (1.0 - share) * value**2)
        return found[0], found[1]


def log_density_with_variation(model: VaryingModel, residuals: WindowResiduals, training: NDArray[np.bool_]) -> float:
    """Return the logarithm of the largest posterior density of a model in `training` windows (W,), if it varies."""
    return _Evidence.of(model, residuals, training).most_likely()[1]


@dataclass(frozen=True)
class _Evidence:
    """What training windows say of the variation of a model: their ``residuals``, those ``used`` (W,), and the prior.

    Few recordings say little about how much recordings differ, and the maps absorb a part of that. The prior is
    therefore the one of `VaryingCriteria`: log-normal, about what servos, floors and batteries differ by, with ``mean``
    and ``spread`` (m + f + 6,) of the logarithms. The components of the maps are left out: what the training windows
    determine varies little.
    """

    residuals: WindowResiduals
    used: NDArray[np.bool_]
    m: int
    f: int
    mean: Floats
    spread: Floats

    @classmethod
    def of(cls, model: VaryingModel, residuals: WindowResiduals, training: NDArray[np.bool_]) -> _Evidence:
        """Return the evidence of the `training` windows (W,)."""
        m, f = len(model.quantities), sum(quantity.varies_within for quantity in model.quantities)
        own = training[residuals.order]
        residuals = residuals.by_first(m).of_recordings(own)
        used = training[residuals.order] & np.isfinite(residuals.residual).all(axis=1)
        between = np.array([_TYPICAL[quantity.unit] for quantity in model.quantities])
        usual = np.append(_usual_lack(residuals, used), [VARYING.time_error_s, VARYING.at_beginning])
        mean = np.log(np.concatenate([between, VARYING.share_within * between[:f], [VARYING.drift_s], usual]))
        of_lack = [*[_WIDE] * _OWN_SCALES, VARYING.spread_time_error, VARYING.spread_at_beginning]
        spread = np.repeat([VARYING.spread_between, VARYING.spread_within, VARYING.spread_drift], [m, f, 1])
        return cls(residuals, used, m, f, mean, np.append(spread, of_lack))

    def parts(self, values: Floats) -> tuple[Floats, Floats, float, Floats]:
        """Return what varies between and within recordings, the drift, and the lack, from all values."""
        m, f = self.m, self.f
        return values[:m], values[m : m + f], values[m + f], values[m + f + 1 :]

    def most_likely(self) -> tuple[Floats, float]:
        """Return the values of maximum posterior density, and the logarithm of it."""
        return _most_likely(
            lambda values: _filtered(self.residuals, *self.parts(values))[1][self.used], self.mean, self.spread
        )

    def most_likely_lack_alone(self) -> Floats:
        """Return the lack of maximum posterior density if nothing varies."""
        nothing, lack = np.zeros(self.m + self.f), slice(self.m + self.f + 1, None)
        between, within = nothing[: self.m], nothing[self.m :]
        return _most_likely(
            lambda values: _filtered(self.residuals, between, within, VARYING.drift_s, values)[1][self.used],
            self.mean[lack],
            self.spread[lack],
        )[0]


def at_end_of_recordings(
    model: VaryingModel, residuals: WindowResiduals, values: Floats, stderr: Floats
) -> dict[str, dict[str, dict[str, float]]]:
    """Return for each recording the quantities and their standard errors at its last window.

    `values` and `stderr` (W, m + r) are those of `Variation.estimates`.
    """
    recording = _initial_states(model.predictor.readings).recording
    last = {str(recording[i]): i for i in residuals.order.tolist()}
    return {
        name: {
            quantity.name: {"value": float(values[i, k]), "stderr": float(stderr[i, k])}
            for k, quantity in enumerate(model.quantities)
        }
        for name, i in last.items()
    }


def _most_likely(density: Callable[[Floats], Floats], mean: Floats, spread: Floats) -> tuple[Floats, float]:
    """Return the positive values (n,) of maximum posterior density, and the logarithm of it.

    Their logarithms have normal priors; `density` returns logarithms of likelihoods.
    """

    def loss(z: Floats) -> float:
        return float(0.5 * np.sum(z**2) - np.sum(density(np.exp(mean + spread * z))))

    found = minimize(loss, np.zeros(len(mean)), method="L-BFGS-B", bounds=[(-4.0, 4.0)] * len(mean))
    return np.asarray(np.exp(mean + spread * found.x)), -float(found.fun)


def _filtered(
    residuals: WindowResiduals, between: Floats, within: Floats, drift_s: float, lack: Floats
) -> tuple[Floats, Floats]:
    """Return estimates with their standard errors (W, 2, m + r) and log predictive densities (W,), in the order.

    The map components (r,) are in units of their standard deviations.
    """
    count, values = len(residuals.order), residuals.slopes.shape[2]
    slow = np.append(between**2, np.ones(values - len(between)))
    variance = residuals.noise + np.sum((lack[:, None] * residuals.scale) ** 2, axis=1) + _LEAST_VARIANCE
    estimates, density = np.empty((count, 2, values)), np.empty(count)
    filter_parameters(
        residuals.restarts, residuals.begins_s, residuals.ends_s, residuals.residual, residuals.slopes, variance,
        slow, within**2, np.array([drift_s, VARYING.within_s]), VARYING.ahead_s, estimates, density,
    )  # fmt: skip
    return estimates, density


def _probability(residuals: WindowResiduals, evidence: Floats) -> Floats:
    """Return the probability of the first hypothesis at the beginning of each window (W,).

    `evidence` (W,) is the logarithm of the ratio of both densities of each window. Windows that ended count.
    """
    probability = np.empty(len(evidence))
    first = np.flatnonzero(residuals.restarts)
    for begin, end in pairwise([*first.tolist(), len(evidence)]):
        own = slice(begin, end)
        ended = np.searchsorted(np.maximum.accumulate(residuals.ends_s[own]), residuals.begins_s[own], side="right")
        total = np.concatenate([[0.0], np.cumsum(evidence[own])])[ended]
        probability[own] = expit(total)
    return probability


def _usual_lack(residuals: WindowResiduals, used: NDArray[np.bool_]) -> Floats:
    """Return half of the median residual of the windows `used`, per distance along, across and in heading (3,)."""
    own = np.array([residuals.scale[used, a, a] for a in range(_OWN_SCALES)]).T
    share = np.abs(residuals.residual[used]) / own
    return np.maximum(0.5 * np.median(share, axis=0) if len(share) else np.zeros(_OWN_SCALES), _WIDE * 1e-4)
