"""Fits that follow the points: a monotone table, and a parametric map corrected by its residuals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agvbench.calibration.maps.map_fit import MapFit, assess_map, require_points, rounded
from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError
from agvbench.types import Floats
from agvbench.vehicle.maps import DeadBandWithSaturation, MonotoneTable


def fit_monotone_table(points: CurvePoints) -> MapFit:
    """Fit the monotone curve closest to the points in least squares (isotonic regression, weighted by repeats).

    Whether it rises or falls is taken from the points. Every point is a knot, so its R² says little: compare by
    cross-validation.

    Raises
    ------
    FitError
        If there are fewer than two commands, or the output does not change with them.
    """
    from scipy.optimize import isotonic_regression

    require_points(points, 2, "monotone table")
    weights = np.maximum(points.repeats, 1).astype(np.float64)
    fits = [isotonic_regression(points.value, weights=weights, increasing=rising).x for rising in (True, False)]
    value = min(fits, key=lambda fit: float(np.sum(weights * (fit - points.value) ** 2)))
    if np.ptp(value) == 0.0:
        raise FitError("the output does not change with the command", value=f"{value[0]:.4g} throughout")
    static_map = MonotoneTable(tuple(points.command.tolist()), tuple(map(rounded, value.tolist())))
    stderr = {f"outputs[{k}]": float(se) for k, se in enumerate(points.stderr) if np.isfinite(se)}
    return assess_map("monotone_table", static_map, points, parameters=len(np.unique(value)), stderr=stderr)


def fit_refined(points: CurvePoints, base: Callable[[CurvePoints], MapFit]) -> MapFit:
    """Fit the map of `base`, add its residuals, interpolated, and make the sum monotone: a table.

    A parametric map knows where a dead band or an end stop begins between two measured commands, which a table alone
    rounds off; but it leaves a residual at every measurement. The residuals are small and smooth, so
    interpolating them is far more accurate than interpolating the measurements. Knots lie at the measured commands,
    half way between them, and at the kinks of the base. A dead band stays zero: a vehicle at neutral stands.

    Raises
    ------
    FitError
        If the base cannot be fitted, or the sum does not change with the command.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import isotonic_regression

    require_points(points, 4, "refined map")
    fit = base(points)
    kept = points.select(fit.used)
    residual = PchipInterpolator(kept.command, kept.value - fit.map(kept.command))
    knots = _knots(kept.command, fit)
    value = fit.map(knots) + residual(knots)
    if isinstance(fit.map, DeadBandWithSaturation):
        value[(knots >= fit.map.low_edge) & (knots <= fit.map.high_edge)] = 0.0
    value = isotonic_regression(value, increasing=fit.map.is_rising).x
    if np.ptp(value) == 0.0:
        raise FitError("the output does not change with the command", value=f"{value[0]:.4g} throughout")
    static_map = MonotoneTable(tuple(map(rounded, knots.tolist())), tuple(map(rounded, value.tolist())))
    return assess_map(
        f"{fit.name}_refined",
        static_map,
        points,
        parameters=len(kept),
        stderr=fit.stderr,
        reasons={out.command: out.why for out in fit.left_out},
    )


def _knots(command: Floats, fit: MapFit) -> Floats:
    """Return the measured commands, the middles between them and the base map's kinks, none too close to another."""
    kinks = list(fit.map.command_range)
    if isinstance(fit.map, DeadBandWithSaturation):
        kinks += [fit.map.low_edge, fit.map.high_edge]
    inside = [kink for kink in kinks if command[0] < kink < command[-1]]
    knots = np.unique(np.concatenate([command, 0.5 * (command[1:] + command[:-1]), inside]))
    apart = 1e-6 * float(command[-1] - command[0])
    return np.asarray(knots[np.concatenate([[True], np.diff(knots) > apart])], dtype=np.float64)
