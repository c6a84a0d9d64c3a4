"""Cosine and sine of the simulation against those of the C library."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from agvbench.model.compiled import compiled
from agvbench.model.simulation.trigonometry import cosine_and_sine
from agvbench.types import Floats


@compiled()
def evaluate(angles: Floats, out: Floats) -> None:
    """Write cosine and sine of each angle into `out`; inner functions have no wrapper of their own."""
    for i in range(len(angles)):
        out[i, 0], out[i, 1] = cosine_and_sine(angles[i])


def of(*angles: float) -> np.ndarray:
    """Return cosine and sine (n, 2) of angles [rad]."""
    out = np.empty((len(angles), 2))
    evaluate(np.array(angles), out)
    return out


@given(st.floats(-20.0, 20.0))
def test_both_agree_with_the_c_library_to_two_units_in_the_last_place(angle: float) -> None:
    """So they do where the series ends and the C library takes over, too."""
    np.testing.assert_allclose(of(angle)[0], [math.cos(angle), math.sin(angle)], rtol=4.5e-16, atol=4.5e-16)


def test_around_the_end_of_the_series() -> None:
    """The largest error of a series is at its end."""
    angles = np.concatenate([sign * (0.25 * math.pi + np.linspace(-1e-3, 1e-3, 201)) for sign in (1.0, -1.0)])
    np.testing.assert_allclose(of(*angles), np.column_stack([np.cos(angles), np.sin(angles)]), rtol=4.5e-16)


def test_what_is_no_angle_stays_visible() -> None:
    """A parameter far from the truth may make an angle infinite; the fit must see that."""
    assert np.isnan(of(math.nan, math.inf)).all()
