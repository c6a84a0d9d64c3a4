"""The residual as rates: that of each step between two samples per metre, with what it may depend on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.types import Floats

FEATURES = ("speed", "sideways", "turning")
_STILL_M = 0.01


@dataclass(frozen=True)
class Rates:
    """The residual per metre driven, between successive samples.

    ``run`` (n,) its run; ``value`` (n, 3): residual along and to the left as a share of the distance, and of curvature
    [1/m]; ``weight`` (n,) metres; ``covariates`` by name (n,); ``begin`` and ``end`` (n, 3) measured poses;
    ``step`` (n,) the number of the sample at its end, the same in repeats.
    """

    run: NDArray[np.int64]
    value: Floats
    weight: Floats
    covariates: dict[str, Floats]
    begin: Floats
    end: Floats
    step: NDArray[np.int64]

    @property
    def middle(self) -> Floats:
        """Where the vehicle was (n, 2)."""
        return np.asarray(0.5 * (self.begin + self.end)[:, :2])

    @property
    def drift(self) -> Floats:
        """The residual on the way, as a drift over the floor (n, 2), in metres per metre driven."""
        heading = 0.5 * (self.begin + self.end)[:, 2]
        along, aside = (self.value[:, :2] * self.covariates["direction"][:, None]).T
        cos, sin = np.cos(heading), np.sin(heading)
        return np.column_stack([cos * along - sin * aside, sin * along + cos * aside])


def residual_rates(readings: Readings, poses: Floats) -> Rates:
    """Return how fast measured and predicted motion part, per metre, with what it may depend on.

    Each step of the measurement is compared in the vehicle's own frame at its beginning with the same step of the
    prediction: what went wrong before does not enter.
    """
    measured = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    predicted = np.concatenate([readings.start[:, None], poses], axis=1)
    t_s = np.column_stack([readings.begins_s, readings.t_s])
    # A step goes from one sample that was seen to the next, however many were not between them.
    last = np.maximum.accumulate(np.where(np.isfinite(measured[..., 0]), np.arange(measured.shape[1]), 0), axis=1)
    rows = np.arange(len(measured))[:, None]
    begin, begin_s = measured[rows, last[:, :-1]], t_s[rows, last[:, :-1]]
    steps_m = _body_steps(begin, measured[:, 1:])
    steps_p = _body_steps(predicted[rows, last[:, :-1]], predicted[:, 1:])
    length = np.hypot(steps_p[..., 0], steps_p[..., 1])
    use = np.isfinite(steps_m).all(axis=-1) & (length > _STILL_M)
    run, step = np.nonzero(use)
    size = length[use]
    direction = np.sign(steps_p[..., 0])[use]
    # By the way driven, forward counted positive: a trim of the axles is the same backward as forward.
    value = (steps_m - steps_p)[use] * (direction / size)[:, None]
    middle = 0.5 * (measured[:, 1:] + begin)[use]
    duration = (t_s[:, 1:] - begin_s)[use]
    driven = (np.cumsum(np.where(use, length, 0.0), axis=1) - 0.5 * length)[use]
    covariates = {
        "x_m": middle[:, 0],
        "y_m": middle[:, 1],
        "heading_rad": np.mod(middle[:, 2], 2.0 * np.pi),
        "time_in_run_s": 0.5 * (t_s[:, 1:] + begin_s)[use],
        "campaign_time_h": readings.started_h[run],
        "speed_mps": size / duration,
        "direction": direction,
        "curvature_per_m": direction * steps_p[..., 2][use] / size,
        "sideslip": direction * steps_p[..., 1][use] / size,
        "distance_m": driven,
    }
    return Rates(run, value, size, covariates, begin[use], measured[:, 1:][use], step)


def _body_steps(begin: Floats, end: Floats) -> Floats:
    """Return steps (R, K, 3) in the frame half way between the headings at their ends."""
    step = end - begin
    heading = 0.5 * (begin[..., 2] + end[..., 2])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack(
        [cos * step[..., 0] + sin * step[..., 1], cos * step[..., 1] - sin * step[..., 0], step[..., 2]], -1
    )
