"""Constants of Gauss–Legendre collocation on one panel, and series for the functions that it needs.

A panel is a stretch of time, scaled to s in [−1, 1], on which a function is known at the eight `NODES`. The
polynomial through these values is integrated exactly: at the nodes by `TO_NODES`, and as coefficients of 1, s, s², …
by `TO_COEFFICIENTS`. Matrices are stored by columns of `PADDED` numbers, a multiple of the width of a vector register.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from agvbench.types import Floats

COUNT = 8
PADDED = 12


def _matrices(nodes: Floats, weights: Floats) -> tuple[Floats, Floats, Floats]:
    degrees = np.arange(COUNT)
    # Gauss quadrature is exact here, so this is the inverse of the Vandermonde matrix.
    to_legendre = (degrees[:, None] + 0.5) * weights * legendre.legvander(nodes, COUNT - 1).T
    integral = np.stack([legendre.legint(column, lbnd=-1.0) for column in to_legendre.T], axis=1)
    to_coefficients = np.stack([legendre.leg2poly(column) for column in integral.T], axis=1)
    return legendre.legvander(nodes, COUNT) @ integral, to_coefficients, to_legendre


def _by_padded_columns(matrix: Floats) -> Floats:
    padded = np.zeros((COUNT, PADDED))
    padded[:, : len(matrix)] = matrix.T
    return padded.ravel()


NODES, WEIGHTS = legendre.leggauss(COUNT)
_TO_NODES, _TO_COEFFICIENTS, _TO_LEGENDRE = _matrices(NODES, WEIGHTS)

#: Elapsed share of the panel at each node, 0 … 1.
ELAPSED: Floats = 0.5 * (NODES + 1.0)
#: ∫ from −1 to each node, from the values at the nodes; padded columns.
TO_NODES = _by_padded_columns(_TO_NODES)
#: Coefficients of 1, s, …, s⁸ of the integral from −1; padded columns.
TO_COEFFICIENTS = _by_padded_columns(_TO_COEFFICIENTS)
#: The last two Legendre coefficients, from the values at the nodes: how fast they fall says what the missing ones are.
TO_LAST: Floats = np.ascontiguousarray(_TO_LEGENDRE[-1])
TO_LAST_BUT_ONE: Floats = np.ascontiguousarray(_TO_LEGENDRE[-2])

#: Taylor coefficients in x² of sin(x)/x and of cos(x): 1e-12 or better for |x| ≤ `SERIES_LIMIT`.
SINE = np.array([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(11)])
COSINE = np.array([(-1.0) ** k / math.factorial(2 * k) for k in range(12)])
SERIES_LIMIT = 2.2
#: Taylor coefficients of exp(x): 1e-16 for −0.625 ≤ x ≤ 0.
EXPONENTIAL = np.array([1.0 / math.factorial(k) for k in range(15)])
