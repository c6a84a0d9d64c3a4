"""The thesis' curve fits: a polynomial of first or third order by least squares, with its R²."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from agvbench.calibration import CurvePoints
from agvbench.calibration.maps.polynomial import fit_cubic, fit_line
from agvbench.types import Floats
from agvbench.vehicle.maps import Cubic, Line


@dataclass(frozen=True)
class Polynomial:
    """Coefficients from the highest power down, and the share of variance explained."""

    coefficients: tuple[float, ...]
    r_squared: float

    def __call__(self, x: Floats | float) -> Floats:
        """Return the value at `x`, in its shape."""
        return np.asarray(np.polyval(self.coefficients, x))


def fit_polynomial(x: Floats, y: Floats, order: int) -> Polynomial:
    """Return the least squares polynomial of `order` 1 or 3, as `agvbench.calibration` fits it.

    >>> line = fit_polynomial(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]), 1)
    >>> [round(c, 9) for c in line.coefficients], round(line.r_squared, 9)
    ([2.0, 1.0], 1.0)
    """
    points = CurvePoints.from_measurements(x, y)
    fit = fit_line(points) if order == 1 else fit_cubic(points)
    if not isinstance(fit.map, (Line, Cubic)):
        raise TypeError(type(fit.map))
    return Polynomial(astuple(fit.map)[: order + 1], fit.r_squared)


def line_held_out_errors(x: Floats, y: Floats, dropped: int) -> Floats:
    """Return the errors of straight lines at every inner point, fitted without it and `dropped` points at each end."""
    index = np.arange(len(x))
    used = (index >= dropped) & (index < len(index) - dropped)
    others = [used & (index != k) for k in index[1:-1]]
    predicted = [float(fit_polynomial(x[o], y[o], 1)(left_out)) for o, left_out in zip(others, x[1:-1], strict=True)]
    return np.asarray(y[1:-1] - predicted)
