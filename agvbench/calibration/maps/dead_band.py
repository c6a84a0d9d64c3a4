"""A drive with a dead band and saturation, with both found in the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.calibration.maps.map_fit import MapFit, assess_map, require_points, rounded
from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError
from agvbench.types import Floats
from agvbench.vehicle.maps import DeadBandWithSaturation

_EXPONENTS = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
_GRID = 24
_MIN_PER_SIDE = 4


def fit_dead_band(points: CurvePoints, *, neutral: float) -> MapFit:
    """Fit a map that is zero about neutral and rises to full output on both sides.

    Each side is fitted by itself: edge of the dead band, saturation and exponent on a grid, the full output in closed
    form, then least squares from the best of the grid (the map has kinks: a descent from one start gets stuck).
    Standard errors come from the Jacobian at the solution.

    Parameters
    ----------
    points
        One per command.
    neutral
        Command inside the dead band.

    Raises
    ------
    FitError
        If a side of neutral has fewer than four commands, or both sides move the same way.
    """
    require_points(points, 2 * _MIN_PER_SIDE, "dead band with saturation")
    low = _fit_side(neutral - points.command, points.value, "below")
    high = _fit_side(points.command - neutral, points.value, "above")
    if not low.full * high.full < 0.0:
        raise FitError("both sides of neutral move the same way", value=f"{low.full:.3g} and {high.full:.3g} m/s")
    static_map = DeadBandWithSaturation(
        low_saturation=rounded(neutral - low.saturation),
        low_edge=rounded(neutral - low.edge),
        high_edge=rounded(neutral + high.edge),
        high_saturation=rounded(neutral + high.saturation),
        low_output=rounded(low.full),
        high_output=rounded(high.full),
        low_exponent=rounded(low.exponent),
        high_exponent=rounded(high.exponent),
    )
    stderr = {f"{side}_{name}": error for side, fit in (("low", low), ("high", high)) for name, error in fit.stderr}
    return assess_map("dead_band_with_saturation", static_map, points, parameters=8, stderr=stderr)


@dataclass(frozen=True)
class _DeadBandSide:
    edge: float
    saturation: float
    exponent: float
    full: float
    stderr: tuple[tuple[str, float], ...]


def _shape(offset: Floats, edge: Floats | float, saturation: Floats | float, exponent: Floats | float) -> Floats:
    """Return the output as a share of full output, `offset` commands from neutral."""
    u = np.clip((offset - edge) / (saturation - edge), 0.0, 1.0)
    return np.asarray(1.0 - (1.0 - u) ** exponent)


def _fit_side(offset: Floats, value: Floats, side: str) -> _DeadBandSide:
    from scipy.optimize import least_squares

    here = offset >= 0.0
    if np.count_nonzero(offset > 0.0) < _MIN_PER_SIDE:
        raise FitError(
            f"too few commands {side} neutral for a dead band",
            value=int(np.count_nonzero(offset > 0.0)),
            limit=f"at least {_MIN_PER_SIDE}",
        )
    x, y = offset[here], value[here]
    farthest = float(x.max())
    edge, saturation, exponent = (
        axis.ravel()
        for axis in np.meshgrid(
            np.linspace(0.0, 0.7 * farthest, _GRID), np.linspace(0.05 * farthest, farthest, _GRID), _EXPONENTS
        )
    )
    wide = saturation - edge > 0.02 * farthest
    edge, saturation, exponent = edge[wide], saturation[wide], exponent[wide]
    shape = _shape(x, edge[:, None], saturation[:, None], exponent[:, None])
    full = shape @ y / np.maximum(np.sum(shape**2, axis=1), 1e-12)
    best = int(np.argmin(np.sum((y - full[:, None] * shape) ** 2, axis=1)))
    scale = np.array([farthest, farthest, 1.0, max(float(np.max(np.abs(y))), 1e-9)])

    def residual(p: Floats) -> Floats:
        edge_, width, exponent_, full_ = p * scale
        return np.asarray((full_ * _shape(x, edge_, edge_ + width, exponent_) - y) / scale[3])

    start = np.array([edge[best], saturation[best] - edge[best], exponent[best], full[best]]) / scale
    bounds = ([0.0, 0.01, 1.0, -1.5], [0.95, 1.5, 4.0, 1.5])
    solved = least_squares(residual, np.clip(start, *bounds), bounds=bounds, x_scale=[0.1, 0.1, 0.5, 0.1], max_nfev=60)
    edge_, width, exponent_, full_ = (solved.x * scale).tolist()
    variance = 2.0 * solved.cost / max(len(x) - 4, 1)
    jacobian = np.asarray(solved.jac, dtype=np.float64)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    errors = np.sqrt(np.diag(covariance)) * scale
    both = float(np.sqrt(covariance[0, 0] + covariance[1, 1] + 2.0 * covariance[0, 1])) * farthest
    names = ("edge", "saturation", "exponent", "output")
    values = (float(errors[0]), both, float(errors[2]), float(errors[3]))
    return _DeadBandSide(edge_, edge_ + width, exponent_, full_, tuple(zip(names, values, strict=True)))
