"""Shapes of what the camera does to positions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.regression import Columns
from agvbench.diagnosis.discrepancy.shapes.base import Evidence, Option, Shapes, Values
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.types import Floats


class _Picture(Values):
    def __call__(self, coefficients: Floats) -> list[float]:
        bend = float(coefficients[0])
        limit = 3.0
        centre = [float(np.clip(s / bend, -limit, limit)) if bend else 0.0 for s in coefficients[1:]]
        return [bend, *centre, 0.0, 0.0][:3]


def camera_shapes(of: Evidence) -> Shapes:
    """Yield the terms of the camera."""
    yield terms.BentPicture, _pictures(of.rates)
    yield terms.SkewedPicture, iter([(_skews(of.rates), Values())])


def _pictures(rates: Rates) -> Iterator[Option]:
    def field(p: Floats) -> Floats:
        """Return displacements (3, n, 2): for the bend about the origin, and for both coordinates of its centre."""
        x, y = p[:, 0], p[:, 1]
        r2 = x * x + y * y
        bend = np.column_stack([r2 * x, r2 * y])
        return np.stack(
            [
                bend,
                np.column_stack([-2.0 * x * x - r2, -2.0 * x * y]),
                np.column_stack([-2.0 * x * y, -2.0 * y * y - r2]),
            ]
        )

    moved = field(rates.end) - field(rates.begin)
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    c, s = np.cos(heading), np.sin(heading)
    per = rates.covariates["direction"] / rates.weight
    longitudinal = (moved[..., 0] * c + moved[..., 1] * s) * per
    lateral = (moved[..., 1] * c - moved[..., 0] * s) * per
    yield {0: longitudinal[:1].T, 1: lateral[:1].T}, _Picture()
    yield {0: longitudinal.T, 1: lateral.T}, _Picture()


def _skews(rates: Rates) -> Columns:
    """Return the regressors of a skew and of a stretch of the position."""
    moved = rates.end - rates.begin
    heading = 0.5 * (rates.begin[:, 2] + rates.end[:, 2])
    displaced = np.column_stack([moved[:, 1], moved[:, 0]]) * (rates.covariates["direction"] / rates.weight)[:, None]
    return {0: displaced * np.cos(heading)[:, None], 1: -displaced * np.sin(heading)[:, None]}
