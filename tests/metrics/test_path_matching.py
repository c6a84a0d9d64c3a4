"""Driven poses against a planned path: offsets are those of the geometry, also where a path crosses itself or turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.metrics.path_matching import track_path


def _along(length_m, turn_per_m, *, direction=1.0, n=400):
    """Return a path (n, 4) that turns by ``turn_per_m(s)`` [rad/m] at each length s, at 1 m/s."""
    s = np.linspace(0.0, length_m, n)
    heading = np.concatenate([[0.0], np.cumsum(turn_per_m(s[:-1] + np.diff(s) / 2.0) * np.diff(s))])
    x = np.concatenate([[0.0], np.cumsum(direction * np.cos((heading[:-1] + heading[1:]) / 2.0) * np.diff(s))])
    y = np.concatenate([[0.0], np.cumsum(direction * np.sin((heading[:-1] + heading[1:]) / 2.0) * np.diff(s))])
    return np.column_stack([s, x, y, heading])


def _shifted(path, left_m):
    """Return the path moved to the left of its heading by ``left_m`` (n,)."""
    moved = path.copy()
    moved[:, 1] -= left_m * np.sin(path[:, 3])
    moved[:, 2] += left_m * np.cos(path[:, 3])
    return moved


@given(st.floats(-0.08, 0.08), st.floats(-1.2, 1.2))
def test_a_parallel_path_has_its_offset_everywhere(offset_m, curvature_per_m):
    planned = _along(2.0, lambda s: np.full_like(s, curvature_per_m))
    found = track_path(_shifted(planned, np.full(len(planned), offset_m)), planned)
    assert found.cross_track_m == pytest.approx(offset_m, abs=2e-3)
    assert found.heading_rad == pytest.approx(0.0, abs=0.02)
    assert np.all(np.diff(found.progress_m) >= 0.0)


def test_left_of_a_backward_path_is_left_of_its_direction():
    planned = _along(2.0, np.zeros_like, direction=-1.0)
    driven = planned + np.array([0.0, 0.0, 0.05, 0.0])
    assert track_path(driven, planned).cross_track_m == pytest.approx(-0.05, abs=1e-6)


def test_a_figure_eight_is_followed_through_its_crossing():
    length_m = 4.0 * np.pi
    planned = _along(length_m, lambda s: np.where(s < length_m / 2.0, 1.0, -1.0), n=2000)
    offset_m = 0.03 * np.sin(np.linspace(0.0, 6.0, len(planned)))
    found = track_path(_shifted(planned, offset_m), planned)
    assert found.progress_m[-1] == pytest.approx(length_m, rel=0.01)
    expected = np.interp(found.progress_m, planned[:, 0], offset_m)
    assert np.abs(found.cross_track_m - expected).max() < 4e-3


def test_three_laps_of_a_circle_are_three_laps():
    planned = _along(6.0 * np.pi, np.ones_like, n=3000)
    found = track_path(_shifted(planned, np.full(len(planned), 0.02)), planned)
    assert found.progress_m[-1] == pytest.approx(6.0 * np.pi, rel=0.01)
    assert np.diff(found.progress_m).max() < 0.2
    assert found.cross_track_m == pytest.approx(0.02, abs=3e-3)


def test_after_a_cusp_the_way_back_is_compared_with_the_way_back():
    ahead = np.linspace(0.0, 1.0, 200)
    planned = np.zeros((400, 4))
    planned[:, 0] = np.linspace(0.0, 2.0, 400)
    planned[:, 1] = np.concatenate([ahead, ahead[::-1]])
    driven = planned.copy()
    driven[:, 1] = np.clip(driven[:, 1], 0.0, 0.9)  # stops 0.1 m early
    driven[200:, 2] = 0.04
    found = track_path(driven, planned)
    back = found.progress_m > 1.15
    assert found.cross_track_m[back] == pytest.approx(-0.04, abs=2e-3)
    assert found.cross_track_m[found.progress_m < 0.85] == pytest.approx(0.0, abs=2e-3)


def test_ending_short_is_no_cross_track_error():
    planned = _along(2.0, np.zeros_like)
    driven = planned[planned[:, 0] < 1.7]
    found = track_path(driven, planned)
    assert np.abs(found.cross_track_m).max() == pytest.approx(0.0, abs=1e-9)


def test_a_vehicle_at_rest_has_no_tracking_error():
    planned = _along(2.0, np.zeros_like)
    assert track_path(np.zeros((50, 4)), planned) is None
    assert track_path(planned, np.zeros((50, 4))) is None
