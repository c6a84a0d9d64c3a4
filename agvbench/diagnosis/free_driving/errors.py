"""Prediction errors of free driving, by predictor and recording, with confidence intervals over blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.window_splits import _initial_states
from agvbench.diagnosis.data.windows import SAMPLES
from agvbench.types import Floats

QUANTITIES = {
    "position_rms_mm": 1e3,
    "heading_rms_deg": 180.0 / np.pi,
    "delta_s_mm": 1e3,
    "delta_heading_deg": 180.0 / np.pi,
}
REPORTED_SAMPLES = (SAMPLES // 2 - 1, SAMPLES - 1)
"""Samples at which errors are reported by recording: at half the horizon and at the horizon."""

_RESAMPLES = 2000
_CONFIDENCE = 0.95
_MIN_BLOCKS = 3


def squares(readings: Readings, poses: Floats, sample: int = -1) -> dict[str, Floats]:
    """Return squared errors (W,) by quantity at `sample`, by default the last; NaN without a measurement.

    Distance is that from the start to the pose, as for runs from rest.
    """
    residual = readings.poses[:, sample] - poses[:, sample]
    start = readings.start[:, :2]
    measured = np.hypot(*(readings.poses[:, sample, :2] - start).T)
    predicted = np.hypot(*(poses[:, sample, :2] - start).T)
    return {
        "position_rms_mm": residual[:, 0] ** 2 + residual[:, 1] ** 2,
        "heading_rms_deg": residual[:, 2] ** 2,
        "delta_s_mm": (measured - predicted) ** 2,
        "delta_heading_deg": residual[:, 2] ** 2,
    }


def repeatability_squares(readings: Readings, perturbed: Floats, sample: int = -1) -> dict[str, Floats]:
    """Return the squared errors (W,) from the noise of frames, a lower bound for every predictor.

    They include the errors of the initial pose, of the measured pose and of the initial speed. `perturbed` (W, K, 3) is
    the change of the prediction by one standard error of the speed. The variation of the vehicle under the same
    commands adds to it. Without repeats this cannot be separated from missing effects, so that the result is a lower
    bound of the repeatability.
    """
    initial_states = _initial_states(readings)
    distance = np.hypot(*(readings.poses[:, sample, :2] - readings.start[:, :2]).T)
    sd = readings.start_stderr
    by_speed = perturbed[:, sample, 0] ** 2 + perturbed[:, sample, 1] ** 2
    position = by_speed + initial_states.noise[:, 0] ** 2 + sd[:, 0] ** 2
    heading = sd[:, 2] ** 2 + initial_states.noise[:, 1] ** 2 + perturbed[:, sample, 2] ** 2
    return {
        "position_rms_mm": position + sd[:, 1] ** 2 + (sd[:, 2] * distance) ** 2 + initial_states.noise[:, 0] ** 2,
        "heading_rms_deg": heading,
        "delta_s_mm": position,
        "delta_heading_deg": heading,
    }


def exceeds_repeatability(readings: Readings, poses: Floats, perturbed: Floats, times: float) -> bool:
    """Return whether an error of predicted `poses` (W, K, 3) at the horizon is several `times` the repeatability.

    That of the vehicle is unknown without repeats. A typical one is assumed, beside the noise of frames: see
    `repeatability_squares`, also for `perturbed`.
    """
    now, least = squares(readings, poses), repeatability_squares(readings, perturbed)
    moved = readings.poses[:, -1] - readings.start
    for name in QUANTITIES:
        way = moved[:, 0] ** 2 + moved[:, 1] ** 2 if name.endswith("_mm") else moved[:, 2] ** 2
        typical = float(np.hypot(rms(least[name], name), RESIDUAL.typical_repeatability * rms(way, name)))
        if rms(now[name], name) > times * typical:
            return True
    return False


def rms(values: Floats, name: str) -> float:
    """Return the root mean square of squared errors in the unit of the quantity's name; NaN if none was measured."""
    measured = values[np.isfinite(values)]
    return QUANTITIES[name] * float(np.sqrt(np.mean(measured))) if len(measured) else np.nan


@dataclass(frozen=True)
class WindowErrors:
    """Position errors [mm] of predictors, in any part of the windows.

    ``predicted`` maps predictors to poses (W, K, 3). ``perturbed`` (W, K, 3) is the change of the prediction by one
    standard error of the initial speed. ``seed`` is that of the bootstrap.
    """

    readings: Readings
    predicted: Mapping[str, Floats]
    perturbed: Floats
    seed: int

    def by_recording(self, held: NDArray[np.bool_], beyond: NDArray[np.bool_]) -> list[dict[str, object]]:
        """Return the errors by recording and prediction time.

        A recording with training and test windows has a row for each kind. ``beyond`` (W,) says which windows have
        commands beyond those of the training windows: test windows ``within`` and ``beyond`` have errors of their own.
        """
        initial_states = _initial_states(self.readings)
        table: list[dict[str, object]] = []
        for recording, is_held in dict.fromkeys(zip(initial_states.recording.tolist(), held.tolist(), strict=True)):
            rows = np.flatnonzero((initial_states.recording == recording) & (held == is_held))
            row: dict[str, object] = {
                "recording": recording,
                "session": str(initial_states.session[rows[0]]),
                "held_out": is_held,
                **self._of(rows),
            }
            if is_held and beyond[rows].any():
                parts = {"within": rows[~beyond[rows]], "beyond": rows[beyond[rows]]}
                row |= {name: self._of(part) for name, part in parts.items() if len(part)}
            table.append(row)
        return table

    @cached_property
    def _prediction_times(self) -> dict[int, str]:
        """The key of each reported sample: its prediction time, the same for every part of the windows."""
        elapsed_s = self.readings.t_s - _initial_states(self.readings).t_s[:, None]
        return {sample: f"ahead_{np.median(elapsed_s[:, sample]):.2g}_s" for sample in REPORTED_SAMPLES}

    def _of(self, rows: NDArray[np.int64]) -> dict[str, object]:
        """Return the errors of the windows `rows`, with 95 % confidence intervals.

        The bootstrap resamples blocks of the recording, because the residuals of a block are correlated.
        """
        readings, initial_states = self.readings, _initial_states(self.readings)
        out: dict[str, object] = {
            "windows": len(rows),
            "median_speed_mps": float(np.median(np.abs(initial_states.speed_mps[rows]))),
        }
        for sample, ahead in self._prediction_times.items():
            repeatability = repeatability_squares(readings, self.perturbed, sample)["position_rms_mm"][rows]
            entry: dict[str, object] = {"floor_mm": rms(repeatability, "position_rms_mm")}
            for name, poses in self.predicted.items():
                squared_mm2 = squares(readings, poses, sample)["position_rms_mm"][rows]
                entry[f"{name}_mm"] = interval(squared_mm2, readings.group[rows], self.seed)
            out[ahead] = entry
        return out


def interval(values: Floats, group: NDArray[np.int64], seed: int) -> dict[str, float]:
    """Return the root mean square [mm] of squared errors [m²] with its confidence interval, by a block bootstrap.

    The bounds are NaN with fewer than three blocks.
    """
    out = {"rms": rms(values, "position_rms_mm"), "low": np.nan, "high": np.nan}
    seen = np.isfinite(values)
    names, index = np.unique(group, return_inverse=True)
    if len(names) < _MIN_BLOCKS:
        return out
    sums = np.bincount(index, weights=np.where(seen, values, 0.0))
    counts = np.bincount(index, weights=seen.astype(np.float64))
    resampled = np.random.default_rng([0xB007, seed]).integers(0, len(names), (_RESAMPLES, len(names)))
    errors = 1e3 * np.sqrt(sums[resampled].sum(axis=1) / np.maximum(counts[resampled].sum(axis=1), 1.0))
    tail = 50.0 * (1.0 - _CONFIDENCE)
    low, high = np.percentile(errors, [tail, 100.0 - tail])
    return {**out, "low": float(low), "high": float(high)}
