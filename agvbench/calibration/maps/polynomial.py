"""First- and third-order fits, as the thesis makes them (section 7.3)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from agvbench.calibration.maps.map_fit import MapFit, assess_map, require_points, rounded, without
from agvbench.calibration.samples import CurvePoints
from agvbench.errors import FitError, VehicleError
from agvbench.types import Floats
from agvbench.vehicle.maps import Cubic, Line


def fit_line(points: CurvePoints, *, name: str = "line", reasons: Mapping[float, str] | None = None) -> MapFit:
    """Fit a first-order polynomial by least squares to the points without a reason to be left out.

    Raise `FitError` if fewer than two points are left, or they show no slope.
    """
    used = points.select(without(points, reasons))
    require_points(used, 2, "line")
    (slope, intercept), (slope_se, intercept_se) = polynomial(used, 1)
    if slope == 0.0:
        raise FitError("the output does not change with the command", value=f"{used.value[0]:.4g} throughout")
    static_map = Line(slope, intercept, command_low=used.command[0], command_high=used.command[-1])
    stderr = {"slope": slope_se, "intercept": intercept_se}
    return assess_map(name, static_map, points, parameters=2, stderr=stderr, reasons=reasons)


def fit_cubic(points: CurvePoints, *, name: str = "cubic", reasons: Mapping[float, str] | None = None) -> MapFit:
    """Fit a third-order polynomial by least squares to the points without a reason to be left out.

    Where the polynomial turns around inside the commands it was fitted to, the map keeps the monotone stretch that
    holds most of them.

    Raises
    ------
    FitError
        If fewer than four points are left, or no stretch of the polynomial is monotone.
    """
    used = points.select(without(points, reasons))
    require_points(used, 4, "cubic")
    coefficients, errors = polynomial(used, 3)
    names = ("cubic", "quadratic", "linear", "constant")
    low, high = _monotone_stretch(coefficients, used.command)
    try:
        static_map = Cubic(**dict(zip(names, coefficients, strict=True)), command_low=low, command_high=high)
    except VehicleError as error:
        raise FitError(f"no usable cubic ({error})") from None
    notes: tuple[str, ...] = ()
    if (low, high) != (used.command[0], used.command[-1]):
        notes = (f"monotone from {low:g} to {high:g} only",)
    return assess_map(
        name,
        static_map,
        points,
        parameters=4,
        stderr=dict(zip(names, errors, strict=True)),
        reasons=reasons,
        notes=notes,
        curve=np.asarray(np.polyval(coefficients, points.command), dtype=np.float64),
    )


def polynomial(points: CurvePoints, order: int) -> tuple[list[float], list[float]]:
    """Return least-squares coefficients, highest order first, and their standard errors.

    Fitted about the middle of the commands, in units of their half range: in µs the powers of 1500 cost seven digits.
    """
    centre = 0.5 * (points.command[0] + points.command[-1])
    scale = 0.5 * (points.command[-1] - points.command[0])
    u = (points.command - centre) / scale
    design = np.vander(u, order + 1)
    solution, *_ = np.linalg.lstsq(design, points.value, rcond=None)
    residual = points.value - design @ solution
    variance = float(residual @ residual) / max(len(u) - order - 1, 1)
    covariance = variance * np.linalg.inv(design.T @ design)
    # Coefficients of powers of c from those of u = (c − centre) / scale: a linear map.
    back = np.zeros((order + 1, order + 1))
    power = np.poly1d([1.0])
    for k in range(order + 1):
        column = np.atleast_1d(power.coeffs)
        back[order + 1 - len(column) :, order - k] = column
        power = power * np.poly1d([1.0 / scale, -centre / scale])
    coefficients = back @ solution
    errors = np.sqrt(np.diag(back @ covariance @ back.T))
    return [rounded(c) for c in coefficients], [float(e) for e in errors]


def _monotone_stretch(coefficients: list[float], commands: Floats) -> tuple[float, float]:
    low, high = float(commands[0]), float(commands[-1])
    turns = np.roots(np.polyder(np.poly1d(coefficients)))
    inside = sorted(float(t.real) for t in turns if abs(t.imag) < 1e-9 and low < t.real < high)
    edges = [low, *inside, high]
    held = [np.count_nonzero((commands >= a) & (commands <= b)) for a, b in pairwise(edges)]
    best = int(np.argmax(held))
    margin = 1e-9 * (high - low)
    return (
        low if best == 0 else edges[best] + margin,
        high if best == len(held) - 1 else edges[best + 1] - margin,
    )
