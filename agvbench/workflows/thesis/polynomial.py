"""The thesis' curve fits: a polynomial of first or third order by least squares, with its R²."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.types import Floats


@dataclass(frozen=True)
class Polynomial:
    """Coefficients from the highest power down, and the share of variance explained."""

    coefficients: tuple[float, ...]
    r_squared: float

    def __call__(self, x: Floats | float) -> Floats:
        """Return the value at `x`, in its shape."""
        return np.asarray(np.polyval(self.coefficients, x))


def fit_polynomial(x: Floats, y: Floats, order: int) -> Polynomial:
    """Return the least squares polynomial of `order`, solved in a centred and scaled variable.

    >>> line = fit_polynomial(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]), 1)
    >>> [round(c, 9) for c in line.coefficients], round(line.r_squared, 9)
    ([2.0, 1.0], 1.0)
    """
    fitted = np.polynomial.Polynomial.fit(x, y, order)
    residual = float(np.sum((y - fitted(x)) ** 2))
    total = float(np.sum((y - y.mean()) ** 2))
    return Polynomial(tuple(float(c) for c in fitted.convert().coef[::-1]), 1.0 - residual / total)
