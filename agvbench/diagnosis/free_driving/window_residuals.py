"""Residuals of windows and their derivatives by what may vary: offset and gain of the steering, and the drive's level.

Residuals are those at half the horizon, in axes of the predicted pose there. They are ordered by recording and time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.free_driving.errors import REPORTED_SAMPLES
from agvbench.diagnosis.model.nodal_maps import ROLES
from agvbench.diagnosis.model.predictor import MAX_ANGLE_RAD, Predictor
from agvbench.types import Floats

_SAMPLE = REPORTED_SAMPLES[0]
_STEP = 1e-3
_LEAST_M = 0.02
_UNCERTAIN_S = 1.0


@dataclass(frozen=True)
class Quantity:
    """What may vary: the offset or the gain of a channel's static map. Gains are natural logarithms of factors."""

    role: str
    is_gain: bool

    @property
    def name(self) -> str:
        """The name with its unit, such as ``front_offset_rad``."""
        return f"{self.role}_gain" if self.is_gain else f"{self.role}_offset_rad"


@dataclass(frozen=True)
class VaryingModel:
    """A fitted model of a vehicle with steered axles, whose ``quantities`` have other values in each window."""

    predictor: Predictor
    parameters: Floats

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """What may vary: offset and gain of each channel that steers, and the gain of the drive.

        A channel with one command in all windows does not steer.
        """
        nodes = self.predictor.maps.nodes
        steered = [role for role in ROLES if role != "drive" and len(nodes[role]) > 1]
        return (*(Quantity(role, is_gain) for role in steered for is_gain in (False, True)), Quantity("drive", True))

    @cached_property
    def residuals(self) -> WindowResiduals:
        """The residuals of all windows, with none of the quantities changed."""
        return WindowResiduals.of(self)

    def poses(self, values: Floats) -> Floats:
        """Return the predicted poses (W, K, 3) for the quantities' `values` (W, m)."""
        batch = self.predictor.batch
        settled, initial = self.predictor.settled(self.parameters)
        of_row = values[batch.base.row_runs]
        for k, quantity in enumerate(self.quantities):
            column = ROLES.index(quantity.role)
            if quantity.is_gain:
                settled[:, column] *= np.exp(of_row[:, k])
            else:
                settled[:, column] += of_row[:, k]
            if quantity.role != "drive":
                settled[:, column] = np.clip(settled[:, column], -MAX_ANGLE_RAD, MAX_ANGLE_RAD)
        parameters, deviation = self.predictor.all_parameters(self.parameters), batch.nodal_deviation
        poses = batch.base.predict(settled, parameters, initial, nodal_deviation=deviation)
        return poses.reshape(len(values), -1, 3)


@dataclass(frozen=True)
class WindowResiduals:
    """Residuals of W windows in the order of recordings and time; the arguments of `filter_parameters`.

    ``order`` (W,): indices of the windows. ``residual`` (W, 3): NaN without a frame, and in the first second of a
    run. ``noise`` (W, 3): variance of the residual by the noise of frames. ``scale`` (W, 4, 3): standard deviations
    of the residual per unit of what the model lacks: in proportion to the distance along the path, across and in
    heading, and per second of an error in time.
    """

    order: NDArray[np.int64]
    restarts: NDArray[np.bool_]
    begins_s: Floats
    ends_s: Floats
    residual: Floats
    slopes: Floats
    noise: Floats
    scale: Floats

    @classmethod
    def of(cls, model: VaryingModel) -> WindowResiduals:
        """Return the residuals of all windows of a model, with none of the quantities changed."""
        readings = model.predictor.readings
        states = _initial_states(readings)
        none = np.zeros((len(readings), len(model.quantities)))
        poses = model.poses(none)
        heading = poses[:, _SAMPLE, 2]
        slopes = np.empty((len(readings), 3, len(model.quantities)))
        for k in range(len(model.quantities)):
            changed = none.copy()
            changed[:, k] = _STEP
            slopes[..., k] = _turned(model.poses(changed)[:, _SAMPLE] - poses[:, _SAMPLE], heading) / _STEP
        begins_s = 3600.0 * readings.started_h + states.t_s
        order = np.lexsort((begins_s, states.recording))
        recording = states.recording[order]
        elapsed_s = np.nan_to_num(readings.t_s - states.t_s[:, None])
        residual = _turned(readings.poses[:, _SAMPLE] - poses[:, _SAMPLE], heading)
        # In a run's first second neither the motion filter nor the model of the actuators knows what was before.
        residual[states.t_s < _UNCERTAIN_S] = np.nan
        of_windows = (begins_s, begins_s + elapsed_s[:, _SAMPLE], residual, slopes, _noise(readings, elapsed_s))
        scale = _scale(readings, poses, np.diff(elapsed_s, axis=1, prepend=0.0))
        return cls(
            order,
            np.r_[True, recording[1:] != recording[:-1]],
            *(np.ascontiguousarray(values[order]) for values in (*of_windows, scale)),
        )


def _turned(changes: Floats, heading: Floats) -> Floats:
    """Return differences of poses (W, 3) in axes that are turned by `heading` (W,)."""
    c, s = np.cos(heading), np.sin(heading)
    x, y, turn = changes.T
    return np.column_stack([c * x + s * y, c * y - s * x, turn])


def _noise(readings: Readings, elapsed_s: Floats) -> Floats:
    """Return the variance (W, 3) of residuals by the noise of the initial state and of the frame."""
    states, start = _initial_states(readings), readings.start_stderr
    along = states.noise[:, 0] ** 2 + start[:, 0] ** 2 + (states.speed_stderr * elapsed_s[:, _SAMPLE]) ** 2
    across = states.noise[:, 0] ** 2 + start[:, 0] ** 2
    return np.column_stack([along, across, states.noise[:, 1] ** 2 + start[:, 2] ** 2])


def _scale(readings: Readings, poses: Floats, interval_s: Floats) -> Floats:
    """Return the standard deviations (W, 4, 3) of residuals per unit of what the model lacks.

    An error in time moves a pose the more, the more speed and yaw rate change within the window.
    """
    motion = np.concatenate([readings.start[:, None], poses[:, : _SAMPLE + 1]], axis=1)
    interval_s = np.maximum(interval_s[:, : _SAMPLE + 1], _STEP)
    yaw_rate = np.diff(motion[..., 2], axis=1) / interval_s
    speed = np.linalg.norm(np.diff(motion[..., :2], axis=1), axis=-1) / interval_s
    by_yaw_rate, by_speed = (np.ptp(np.nan_to_num(rates), axis=1) for rates in (yaw_rate, speed))
    distance = np.hypot(*(motion[:, -1, :2] - motion[:, 0, :2]).T)
    turned = np.abs(motion[:, -1, 2] - motion[:, 0, 2])
    scale = np.zeros((len(poses), 4, 3))
    scale[:, 0, 0] = scale[:, 1, 1] = distance + _LEAST_M
    scale[:, 2, 2] = np.hypot(distance, turned) + _LEAST_M
    scale[:, 3] = np.column_stack([by_speed, 0.5 * distance * by_yaw_rate, by_yaw_rate])
    return scale
