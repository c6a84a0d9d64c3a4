"""Residuals of windows, and their derivatives by what differs between recordings.

Residuals are those at half the horizon, in axes of the predicted pose there. They are ordered by recording and time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.data.windows import DIFFERENTIAL_HISTORY_S, HISTORY_S
from agvbench.diagnosis.free_driving.errors import REPORTED_SAMPLES
from agvbench.diagnosis.free_driving.varying_model import VaryingModel, in_turned_axes
from agvbench.types import Floats

_SAMPLE = REPORTED_SAMPLES[0]
_SHORTEST_S = 1e-3
_LEAST_M = 0.02
_UNCERTAIN_S = 1.0
_TIME_CONSTANTS = 4.0


@dataclass(frozen=True)
class WindowResiduals:
    """Residuals of W windows in the order of recordings and time; the arguments of `filter_parameters`.

    ``order`` (W,): indices of the windows. ``residual`` (W, 3): NaN without a frame, and in the first second of a
    run. ``slopes`` (W, 3, m + r): derivatives by the quantities and the map components of `VaryingModel`. ``noise``
    (W, 3): variance of the residual by the noise of frames. ``scale`` (W, 5, 3): standard deviations of the residual
    per unit of what the model lacks: in proportion to the distance along the path, across and in heading; per second
    of an error in time; and in proportion to the distance, at the beginning of a run.
    """

    order: NDArray[np.int64]
    restarts: NDArray[np.bool_]
    begins_s: Floats
    ends_s: Floats
    residual: Floats
    slopes: Floats
    noise: Floats
    scale: Floats

    def by_first(self, count: int) -> WindowResiduals:
        """Return these residuals with derivatives by the first `count` values only."""
        return replace(self, slopes=np.ascontiguousarray(self.slopes[..., :count]))

    def of_recordings(self, chosen: NDArray[np.bool_]) -> WindowResiduals:
        """Return the residuals of those recordings of which any window is `chosen` (W,), in the order."""
        recording = np.cumsum(self.restarts)
        kept = np.isin(recording, recording[chosen])
        return WindowResiduals(*(getattr(self, field.name)[kept] for field in fields(self)))

    @classmethod
    def of(cls, model: VaryingModel) -> WindowResiduals:
        """Return the residuals of all windows of a model, with none of the quantities changed."""
        readings = model.predictor.readings
        states = _initial_states(readings)
        poses = model.as_fitted
        begins_s = 3600.0 * readings.started_h + states.t_s
        order = np.lexsort((begins_s, states.recording))
        recording = states.recording[order]
        elapsed_s = np.nan_to_num(readings.t_s - states.t_s[:, None])
        residual = in_turned_axes(readings.poses[:, _SAMPLE] - poses[:, _SAMPLE], poses[:, _SAMPLE, 2])
        # In a run's first second neither the motion filter nor the model of the actuators knows what was before.
        residual[states.t_s < _UNCERTAIN_S] = np.nan
        of_windows = (begins_s, begins_s + elapsed_s[:, _SAMPLE], residual, _slopes(model), _noise(readings, elapsed_s))
        history_s = DIFFERENTIAL_HISTORY_S if model.predictor.batch.geometry.is_differential else HISTORY_S
        begun = np.exp(-_TIME_CONSTANTS * states.t_s / history_s)
        scale = _scale(readings, poses, np.diff(elapsed_s, axis=1, prepend=0.0), begun)
        return cls(
            order,
            np.r_[True, recording[1:] != recording[:-1]],
            *(np.ascontiguousarray(values[order]) for values in (*of_windows, scale)),
        )


def _slopes(model: VaryingModel) -> Floats:
    """Return the derivatives (W, 3, m + r) of poses by what differs between recordings."""
    poses = model.as_fitted[:, _SAMPLE]
    changes = [model.poses(np.tile(step, (len(poses), 1)))[:, _SAMPLE] - poses for step in np.diag(model.steps)]
    return np.stack([in_turned_axes(change, poses[:, 2]) for change in changes], axis=-1) / model.steps


def _noise(readings: Readings, elapsed_s: Floats) -> Floats:
    """Return the variance (W, 3) of residuals by the noise of the initial state and of the frame."""
    states, start = _initial_states(readings), readings.start_stderr
    along = states.noise[:, 0] ** 2 + start[:, 0] ** 2 + (states.speed_stderr * elapsed_s[:, _SAMPLE]) ** 2
    across = states.noise[:, 0] ** 2 + start[:, 0] ** 2
    return np.column_stack([along, across, states.noise[:, 1] ** 2 + start[:, 2] ** 2])


def _scale(readings: Readings, poses: Floats, interval_s: Floats, begun: Floats) -> Floats:
    """Return the standard deviations (W, 5, 3) of residuals per unit of what the model lacks.

    An error in time moves a pose the more, the more speed and yaw rate change within the window. `begun` (W,) is how
    much of the actuators' state comes from the time before the run, of which no commands are known.
    """
    motion = np.concatenate([readings.start[:, None], poses[:, : _SAMPLE + 1]], axis=1)
    interval_s = np.maximum(interval_s[:, : _SAMPLE + 1], _SHORTEST_S)
    yaw_rate = np.diff(motion[..., 2], axis=1) / interval_s
    speed = np.linalg.norm(np.diff(motion[..., :2], axis=1), axis=-1) / interval_s
    by_yaw_rate, by_speed = (np.ptp(np.nan_to_num(rates), axis=1) for rates in (yaw_rate, speed))
    distance = np.hypot(*(motion[:, -1, :2] - motion[:, 0, :2]).T)
    turned = np.abs(motion[:, -1, 2] - motion[:, 0, 2])
    scale = np.zeros((len(poses), 5, 3))
    scale[:, 0, 0] = scale[:, 1, 1] = distance + _LEAST_M
    scale[:, 2, 2] = np.hypot(distance, turned) + _LEAST_M
    scale[:, 3] = np.column_stack([by_speed, 0.5 * distance * by_yaw_rate, by_yaw_rate])
    scale[:, 4] = begun[:, None] * scale[:, :3].sum(axis=1)
    return scale
