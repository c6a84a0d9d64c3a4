"""How far predictions of free driving are off, by predictor and recording, with intervals over stretches of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

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
AHEAD = (SAMPLES // 2 - 1, SAMPLES - 1)
"""Samples at which errors are reported by recording: half the horizon ahead, and all of it."""

_RESAMPLES = 2000
_CONFIDENCE = 0.95
_MIN_BLOCKS = 3


def squares(readings: Readings, poses: Floats, sample: int = -1) -> dict[str, Floats]:
    """Return squared errors (W,) by quantity, `sample` being the last one by default; NaN where nothing was seen.

    Distance is that from the start to the pose, as for runs from rest.
    """
    residual = readings.poses[:, sample] - poses[:, sample]
    start = readings.start[:, :2]
    went = np.hypot(*(readings.poses[:, sample, :2] - start).T)
    predicted = np.hypot(*(poses[:, sample, :2] - start).T)
    return {
        "position_rms_mm": residual[:, 0] ** 2 + residual[:, 1] ** 2,
        "heading_rms_deg": residual[:, 2] ** 2,
        "delta_s_mm": (went - predicted) ** 2,
        "delta_heading_deg": residual[:, 2] ** 2,
    }


def repeatability_squares(readings: Readings, perturbed: Floats, sample: int = -1) -> dict[str, Floats]:
    """Return the squares (W,) that no predictor can avoid, from the noise of frames.

    The pose to start from is uncertain, so is the pose that is judged, and so is the speed to start from: `perturbed`
    (W, K, 3) is by how much the prediction changes with a standard error of it. What the vehicle does differently
    without a cause in its commands comes on top: without repeats it cannot be separated from what a model lacks, so
    this is a lower bound of the repeatability.
    """
    initial_states = _initial_states(readings)
    went = np.hypot(*(readings.poses[:, sample, :2] - readings.start[:, :2]).T)
    sd = readings.start_stderr
    by_speed = perturbed[:, sample, 0] ** 2 + perturbed[:, sample, 1] ** 2
    along = by_speed + initial_states.noise[:, 0] ** 2 + sd[:, 0] ** 2
    heading = sd[:, 2] ** 2 + initial_states.noise[:, 1] ** 2 + perturbed[:, sample, 2] ** 2
    return {
        "position_rms_mm": along + sd[:, 1] ** 2 + (sd[:, 2] * went) ** 2 + initial_states.noise[:, 0] ** 2,
        "heading_rms_deg": heading,
        "delta_s_mm": along,
        "delta_heading_deg": heading,
    }


def rms(values: Floats, name: str) -> float:
    """Return the root mean square of squared errors in the unit of the quantity's name."""
    return QUANTITIES[name] * float(np.sqrt(np.nanmean(values)))


def by_recording(
    readings: Readings, predicted: Mapping[str, Floats], perturbed: Floats, held: NDArray[np.bool_], seed: int
) -> list[dict[str, object]]:
    """Return a table: for each recording and each time ahead the position error [mm] of every predictor.

    Each error is a root mean square with its 95 % interval, by resampling stretches of the recording: windows of one
    stretch miss alike.
    """
    initial_states = _initial_states(readings)
    table: list[dict[str, object]] = []
    for recording in dict.fromkeys(initial_states.recording.tolist()):
        own = initial_states.recording == recording
        rows = np.flatnonzero(own)
        row: dict[str, object] = {
            "recording": recording,
            "session": str(initial_states.session[rows[0]]),
            "held_out": bool(held[rows].all()),
            "windows": len(rows),
            "median_speed_mps": float(np.median(np.abs(initial_states.speed_mps[rows]))),
        }
        for sample in AHEAD:
            ahead = float(np.median(readings.t_s[rows, sample] - initial_states.t_s[rows]))
            repeatability = repeatability_squares(readings, perturbed, sample)["position_rms_mm"][rows]
            entry: dict[str, object] = {"floor_mm": rms(repeatability, "position_rms_mm")}
            for name, poses in predicted.items():
                squared_mm2 = squares(readings, poses, sample)["position_rms_mm"][rows]
                entry[f"{name}_mm"] = interval(squared_mm2, readings.group[rows], seed)
            row[f"ahead_{ahead:.2g}_s"] = entry
        table.append(row)
    return table


def interval(values: Floats, group: NDArray[np.int64], seed: int) -> dict[str, float]:
    """Return the root mean square [mm] of squared errors [m²] with its interval, from draws of whole stretches.

    The bounds are NaN where there are fewer than three stretches.
    """
    out = {"rms": rms(values, "position_rms_mm"), "low": np.nan, "high": np.nan}
    seen = np.isfinite(values)
    names, index = np.unique(group, return_inverse=True)
    if len(names) < _MIN_BLOCKS:
        return out
    sums = np.bincount(index, weights=np.where(seen, values, 0.0))
    counts = np.bincount(index, weights=seen.astype(np.float64))
    drawn = np.random.default_rng([0xB007, seed]).integers(0, len(names), (_RESAMPLES, len(names)))
    errors = 1e3 * np.sqrt(sums[drawn].sum(axis=1) / np.maximum(counts[drawn].sum(axis=1), 1.0))
    tail = 50.0 * (1.0 - _CONFIDENCE)
    low, high = np.percentile(errors, [tail, 100.0 - tail])
    return {**out, "low": float(low), "high": float(high)}
