"""A measured curve made monotone."""

from __future__ import annotations

import numpy as np

from agvbench.calibration.map_fit import MapFit, judge, require_points, rounded
from agvbench.calibration.points import CurvePoints
from agvbench.errors import FitError
from agvbench.vehicle.maps import MonotoneTable


def fit_monotone_table(points: CurvePoints, *, interpolation: str = "pchip") -> MapFit:
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
    static_map = MonotoneTable(tuple(points.command.tolist()), tuple(rounded(v) for v in value.tolist()), interpolation)
    stderr = {f"outputs[{k}]": float(se) for k, se in enumerate(points.stderr) if np.isfinite(se)}
    return judge("monotone_table", static_map, points, parameters=len(np.unique(value)), stderr=stderr)
