"""Select the map of a steered axle or of the drive: one kind, the thesis' way, or by cross-validation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from agvbench.calibration.maps.dead_band import fit_dead_band
from agvbench.calibration.maps.end_stops import fit_line_with_end_stops
from agvbench.calibration.maps.map_fit import MapFit
from agvbench.calibration.maps.polynomial import fit_cubic, fit_line
from agvbench.calibration.maps.table import fit_monotone_table, fit_refined
from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError, InputError, OneOf

Fitter = Callable[[CurvePoints], MapFit]

# In order of preference: a kind further down has to predict clearly better than all before it.
STEERING_KINDS = ("line_with_end_stops", "line_with_end_stops_refined", "line", "monotone_table")
DRIVE_KINDS = ("dead_band_with_saturation_refined", "dead_band_with_saturation", "monotone_table", "cubic", "line")
_CLEARLY = 1.5
_NOTHING = 1e-6  # of the range of outputs: errors so small are equal
_SATURATED_SHARE = 0.02


def fit_steering_map(command: ArrayLike, value: ArrayLike, kind: str = "default") -> MapFit:
    """Fit command → axle angle.

    Parameters
    ----------
    command
        Shape (n,), command units; repeats are welcome and enter as their median.
    value
        Shape (n,), axle angle [rad].
    kind
        ``"line_with_end_stops"``, ``"line"`` (all points), ``"monotone_table"``, ``"line_with_end_stops_refined"``
        (`fit_refined`); ``"thesis"`` for eq. 7.1 and 7.2: a line without the outermost point at each end;
        ``"default"`` for the first of `STEERING_KINDS` that none predicts clearly better than (`compare_maps`).

    Raises
    ------
    FitError
        If the measurements do not determine such a map.
    InputError
        If `kind` is unknown.
    """
    points = CurvePoints.from_measurements(command, value)
    return _fit(points, kind, steering_fitters())


def fit_drive_map(command: ArrayLike, value: ArrayLike, kind: str = "default", *, neutral: float) -> MapFit:
    """Fit command → speed of the axles [m/s].

    Parameters and errors are those of `fit_steering_map`, with the kinds ``"dead_band_with_saturation"`` and its
    ``…_refined``, ``"monotone_table"``, ``"cubic"``, ``"line"``, and ``"thesis"`` for eq. 7.3: a cubic through the
    points up to saturation. `neutral` is the command at which the vehicle stands.
    """
    points = CurvePoints.from_measurements(command, value)
    return _fit(points, kind, drive_fitters(neutral))


def steering_fitters() -> dict[str, Fitter]:
    """Return how each kind of steering map is fitted."""
    return {
        "line_with_end_stops": fit_line_with_end_stops,
        "line_with_end_stops_refined": lambda points: fit_refined(points, fit_line_with_end_stops),
        "line": fit_line,
        "monotone_table": fit_monotone_table,
        "thesis": lambda points: fit_line(points, name="thesis", reasons=_outermost(points)),
    }


def drive_fitters(neutral: float) -> dict[str, Fitter]:
    """Return how each kind of drive map is fitted."""

    def dead_band(points: CurvePoints) -> MapFit:
        return fit_dead_band(points, neutral=neutral)

    return {
        "dead_band_with_saturation": dead_band,
        "dead_band_with_saturation_refined": lambda points: fit_refined(points, dead_band),
        "monotone_table": fit_monotone_table,
        "cubic": fit_cubic,
        "line": fit_line,
        "thesis": lambda points: fit_cubic(points, name="thesis", reasons=_saturated(points, neutral)),
    }


def compare_maps(points: CurvePoints, fitters: dict[str, Fitter]) -> dict[str, MapFit | FitError]:
    """Fit each kind to all points and cross-validate it; a kind that cannot be fitted keeps its error.

    Cross-validation leaves out one command at a time, all its repeats together, and predicts it from the rest. The
    outermost commands are never left out: what lies beyond the others would be judged by extrapolation.
    """
    fits: dict[str, MapFit | FitError] = {}
    for name, fitter in fitters.items():
        try:
            fits[name] = replace(fitter(points), cross_validated_rms=_cross_validate(points, fitter))
        except FitError as error:
            fits[name] = error
    return fits


def preferred(fits: dict[str, MapFit | FitError], order: tuple[str, ...]) -> MapFit:
    """Return the first fit in `order` that no other predicts clearly better (by half as much again).

    Raise `FitError`, that of the first in `order`, if none could be fitted.
    """
    good = [fit for name in order if isinstance(fit := fits.get(name), MapFit)]
    if not good:
        raise next(error for name in order if isinstance(error := fits.get(name), FitError))
    known = [fit.cross_validated_rms for fit in good if np.isfinite(fit.cross_validated_rms)]
    limit = _CLEARLY * min(known, default=np.inf) + _NOTHING * float(np.ptp(good[0].points.value))
    return next((fit for fit in good if fit.cross_validated_rms <= limit), good[0])


def _fit(points: CurvePoints, kind: str, fitters: dict[str, Fitter]) -> MapFit:
    if kind == "default":
        order = STEERING_KINDS if "line_with_end_stops" in fitters else DRIVE_KINDS
        return preferred(compare_maps(points, {name: fitters[name] for name in order}), order)
    if kind not in fitters:
        raise InputError("unknown kind of fit", where="kind", value=repr(kind), limit=OneOf(("default", *fitters)))
    return fitters[kind](points)


def _cross_validate(points: CurvePoints, fitter: Fitter) -> float:
    """Return the rms of leave-one-command-out predictions; NaN if a fit without one command is impossible."""
    errors = []
    every = np.arange(len(points))
    for k in range(1, len(points) - 1):
        try:
            fit = fitter(points.select(every != k))
        except FitError:
            return np.nan
        errors.append(float(fit.map(points.command[k])) - points.value[k])
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan


def _outermost(points: CurvePoints) -> dict[float, str]:
    return dict.fromkeys(
        (float(points.command[0]), float(points.command[-1])) if len(points) > 2 else (),
        "the outermost command at each end, left out as in the thesis",
    )


def _saturated(points: CurvePoints, neutral: float) -> dict[float, str]:
    """Return the commands beyond the first saturated one on each side of neutral (thesis fig. 7.5)."""
    out: dict[float, str] = {}
    for side in (points.command < neutral, points.command > neutral):
        if not side.any():
            continue
        full = float(np.max(np.abs(points.value[side])))
        flat = side & (np.abs(points.value) >= (1.0 - _SATURATED_SHARE) * full)
        distance = np.abs(points.command - neutral)
        beyond = side & (distance > float(np.min(distance[flat])))
        out |= dict.fromkeys(points.command[beyond].tolist(), "saturated: beyond the first command at full speed")
    return out
