"""The residual of each step between two samples, per metre driven, with the covariates of the step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.types import Floats

FEATURES = ("speed", "sideways", "turning")
_MIN_STEP_M = 0.01


class LoggedSteps(NamedTuple):
    """A logged column at n steps: ``value`` (n,), NaN where missing; the number of a level if it is a text."""

    value: Floats
    is_text: bool


@dataclass(frozen=True)
class Rates:
    """The residual per metre driven of n steps between successive samples.

    ``run`` (n,): index of the run; ``value`` (n, 3): longitudinal and lateral residual as a share of the distance, and
    residual of curvature [1/m]; ``weight`` (n,): distance [m]; ``covariates``: (n,) by name; ``begin`` and ``end``
    (n, 3): measured poses; ``step`` (n,): index of the sample at the end of the step, the same in repeats. ``logged``:
    the columns that the lab logged, by name; ``standardised`` (n, S): the regressors of the run of each step.
    """

    run: NDArray[np.int64]
    value: Floats
    weight: Floats
    covariates: dict[str, Floats]
    begin: Floats
    end: Floats
    step: NDArray[np.int64]
    logged: Mapping[str, LoggedSteps] = field(default_factory=dict)
    standardised: Floats = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def middle(self) -> Floats:
        """The mean position of the vehicle during each step (n, 2) [m]."""
        return np.asarray(0.5 * (self.begin + self.end)[:, :2])

    @property
    def drift(self) -> Floats:
        """The residual as a drift in the floor frame (n, 2), in metres per metre driven."""
        heading = 0.5 * (self.begin + self.end)[:, 2]
        longitudinal, lateral = (self.value[:, :2] * self.covariates["direction"][:, None]).T
        cos, sin = np.cos(heading), np.sin(heading)
        return np.column_stack([cos * longitudinal - sin * lateral, sin * longitudinal + cos * lateral])


def residual_rates(readings: Readings, poses: Floats) -> Rates:
    """Return the residuals of steps between predicted `poses` (R, K, 3) and measured ones, per metre.

    Each measured step is compared with the predicted one in the vehicle frame. Errors before the step do not enter.
    """
    measured = np.concatenate([readings.start[:, None], readings.poses], axis=1)
    predicted = np.concatenate([readings.start[:, None], poses], axis=1)
    t_s = np.column_stack([readings.begins_s, readings.t_s])
    # A step leads from one measured sample to the next, over any number of missing samples.
    last = np.maximum.accumulate(np.where(np.isfinite(measured[..., 0]), np.arange(measured.shape[1]), 0), axis=1)
    rows = np.arange(len(measured))[:, None]
    begin, begin_s = measured[rows, last[:, :-1]], t_s[rows, last[:, :-1]]
    steps_m = _body_steps(begin, measured[:, 1:])
    steps_p = _body_steps(predicted[rows, last[:, :-1]], predicted[:, 1:])
    length = np.hypot(steps_p[..., 0], steps_p[..., 1])
    use = np.isfinite(steps_m).all(axis=-1) & (length > _MIN_STEP_M)
    run, step = np.nonzero(use)
    size = length[use]
    direction = np.sign(steps_p[..., 0])[use]
    # The sign of the direction makes an offset of the axles equal in forward and backward driving.
    value = (steps_m - steps_p)[use] * (direction / size)[:, None]
    middle = 0.5 * (measured[:, 1:] + begin)[use]
    duration = (t_s[:, 1:] - begin_s)[use]
    signed = np.where(use, np.copysign(length, steps_p[..., 0]), 0.0)
    rolled = (np.cumsum(signed, axis=1) - 0.5 * signed)[use]
    covariates = {
        "x_m": middle[:, 0],
        "y_m": middle[:, 1],
        "heading_rad": np.mod(middle[:, 2], 2.0 * np.pi),
        "course_rad": np.mod(middle[:, 2] + np.arctan2(steps_p[..., 1][use], steps_p[..., 0][use]), 2.0 * np.pi),
        "time_in_run_s": 0.5 * (t_s[:, 1:] + begin_s)[use],
        "campaign_time_h": readings.started_h[run],
        "speed_mps": size / duration,
        "direction": direction,
        "curvature_per_m": direction * steps_p[..., 2][use] / size,
        "sideslip": direction * steps_p[..., 1][use] / size,
        "distance_m": rolled,
    }
    logged = {
        # Without a sample at the beginning of the step, `last` is the one before.
        column.name: LoggedSteps(
            0.5 * (column.values[rows, last[:, :-1]] + column.values[:, 1:])[use], bool(column.levels)
        )
        for column in readings.logged.columns
    }
    standardised = readings.logged.standardised(len(readings))[run]
    return Rates(run, value, size, covariates, begin[use], measured[:, 1:][use], step, logged, standardised)


def _body_steps(begin: Floats, end: Floats) -> Floats:
    """Return steps (R, K, 3) in the vehicle frame at their mean heading."""
    step = end - begin
    heading = 0.5 * (begin[..., 2] + end[..., 2])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack(
        [cos * step[..., 0] + sin * step[..., 1], cos * step[..., 1] - sin * step[..., 0], step[..., 2]], -1
    )
