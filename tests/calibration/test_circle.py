"""Circle fits against their Cramér–Rao bound, a general optimiser and points that are no arc."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from agvbench.calibration import fit_circle, fit_circles
from agvbench.errors import AgvbenchError, InputError, NotAnArcError

NOISE = 5e-4
METHODS = ("default", "landau_smith")


def arcs(rng, count, degrees, *, radius=2.0, points=300, noise=NOISE):
    """Return noisy points (count, points, 2), their angles and true (cx, cy, R)."""
    span = np.radians(rng.uniform(*degrees, count))
    angle = rng.uniform(0, 2 * np.pi, count)[:, None] + span[:, None] * np.linspace(0, 1, points)
    center = rng.uniform(-3, 3, (count, 2))
    true = center[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    return true + noise * rng.standard_normal(true.shape), angle, np.column_stack([center, np.full(count, radius)])


def cramer_rao(angle, noise=NOISE):
    """Return the lower bounds (count, 3) of the variances of cx, cy and R."""
    jacobian = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], -1)
    return np.stack([np.diag(np.linalg.inv(j.T @ j)) for j in jacobian]) * noise**2


def estimates(fits):
    return np.column_stack([fits.center, fits.radius])


def test_a_thousand_partial_arcs_attain_the_cramer_rao_bound():
    points, angle, true = arcs(np.random.default_rng(1), 1000, (60, 180))
    bound = cramer_rao(angle)
    fits = fit_circles(points)
    assert not any(fits.reason)
    squared = (estimates(fits) - true) ** 2 / bound
    assert np.sqrt(squared.mean()) <= 1.05
    assert np.all(np.sqrt(squared.mean(axis=0)) <= 1.05)


def test_standard_errors_are_those_of_the_bound_and_cover_the_truth():
    points, angle, true = arcs(np.random.default_rng(2), 2000, (40, 300))
    fits = fit_circles(points)
    errors = np.column_stack([fits.center_stderr, fits.radius_stderr])
    assert np.allclose(errors / np.sqrt(cramer_rao(angle)), 1.0, atol=0.2)
    covered = np.abs(estimates(fits) - true) < 1.96 * errors
    assert np.all(np.abs(covered.mean(axis=0) - 0.95) < 0.02)
    assert np.allclose(fits.rms, NOISE, rtol=0.2)
    assert np.allclose(fits.arc_rad, np.ptp(angle, axis=1), atol=0.01)


def test_the_default_is_the_least_squares_circle():
    points, _, true = arcs(np.random.default_rng(3), 20, (30, 350), noise=0.02, points=60)
    for arc, start, found in zip(points, true, estimates(fit_circles(points)), strict=True):
        best = least_squares(lambda p, arc=arc: np.hypot(*(arc - p[:2]).T) - p[2], start, xtol=1e-14, ftol=1e-14)
        assert np.allclose(found, best.x, atol=2e-4 * np.abs(best.x).max())


def test_landau_smith_is_the_closed_form_and_falls_short_on_short_arcs():
    points, _, _ = arcs(np.random.default_rng(4), 5, (60, 180))
    for arc, fit in zip(points, estimates(fit_circles(points, "landau_smith")), strict=True):
        # Thomas & Chan minimise the area between circle and points, which is linear in (cx, cy, R² − cx² − cy²).
        a = np.column_stack([2 * arc, np.ones(len(arc))])
        cx, cy, rest = np.linalg.lstsq(a, (arc**2).sum(1), rcond=None)[0]
        assert np.allclose(fit, [cx, cy, np.sqrt(rest + cx**2 + cy**2)], rtol=1e-9)
    noisy, _, _ = arcs(np.random.default_rng(5), 400, (25, 25), noise=0.005)
    thesis, ours = fit_circles(noisy, "landau_smith"), fit_circles(noisy)
    assert np.nanmean(thesis.radius) < 1.97 < np.nanmean(ours.radius)


@given(st.floats(0.2, 5.9), st.floats(0.05, 50), st.floats(0, 6.3), st.floats(-100, 100), st.booleans(), st.data())
@settings(max_examples=200, deadline=None)
def test_exact_arcs_anywhere_are_found_in_any_order(span, radius, start, offset, shuffle, data):
    angle = start + span * np.linspace(0, 1, 40)
    points = np.column_stack([offset + radius * np.cos(angle), radius * np.sin(angle) - offset])
    if shuffle:
        points = points[np.random.default_rng(data.draw(st.integers(0, 9))).permutation(40)]
    for method in METHODS:
        fit = fit_circle(points, method)
        tolerance = 1e-9 * (radius + abs(offset)) / min(span, 1) ** 4
        assert np.allclose(fit.center, [offset, -offset], atol=tolerance)
        assert abs(fit.radius - radius) < tolerance
        assert abs(fit.arc_rad - span) < 1e-5


def test_whole_and_repeated_circles():
    angle = np.linspace(0, 14, 500)
    fit = fit_circle(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert np.allclose(fit.center, 0, atol=1e-9)
    assert fit.radius == pytest.approx(1.0)
    assert fit.arc_rad == pytest.approx(2 * np.pi, abs=0.1)


def test_moving_and_turning_the_floor_moves_and_turns_the_circle():
    points, _, _ = arcs(np.random.default_rng(6), 1, (90, 90))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    before, after = fit_circle(points[0]), fit_circle(points[0] @ turn.T + [5.0, -7.0])
    assert np.allclose(after.center, turn @ before.center + [5.0, -7.0], atol=1e-6)
    assert after.radius == pytest.approx(before.radius, abs=1e-6)


RNG = np.random.default_rng(7)
LINE = np.column_stack([np.linspace(0, 2, 300), np.linspace(1, 0, 300)])
BAD = {
    "exact line": (LINE, "straight within its noise"),
    "noisy line": (LINE + NOISE * RNG.standard_normal(LINE.shape), "straight within its noise"),
    "five points": (arcs(RNG, 1, (90, 90), points=5)[0][0], "5 points"),
    "no points": (np.empty((0, 2)), "0 points"),
    "one NaN": (np.vstack([arcs(RNG, 1, (90, 90))[0][0], [np.nan, 0]]), "not all of them finite"),
    "infinite": (np.vstack([arcs(RNG, 1, (90, 90))[0][0], [np.inf, 0]]), "not all of them finite"),
    "all NaN": (np.full((300, 2), np.nan), "not all of them finite"),
    "five degrees": (arcs(RNG, 1, (5, 5))[0][0], "straight within its noise"),
    "five clean degrees": (arcs(RNG, 1, (5, 5), noise=0)[0][0], "5.0° of a circle"),
    "one place": (np.ones((300, 2)), "all in one place"),
    "resting, with noise": (NOISE * RNG.standard_normal((300, 2)), "mm noise"),
    "a cloud": (RNG.uniform(-1, 1, (300, 2)), "mm noise"),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("method", METHODS)
def test_what_is_no_arc_is_refused_in_one_line_with_the_numbers(name, method):
    points, why = BAD[name]
    with pytest.raises(NotAnArcError, match=r"^not an arc: ") as caught:
        fit_circle(points, method)
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.lists(st.tuples(st.floats(), st.floats()), max_size=30))
@settings(deadline=None)
def test_no_points_whatever_break_it(points):
    for method in METHODS:
        try:
            fit = fit_circle(np.array(points).reshape(-1, 2), method)
        except AgvbenchError:
            continue
        assert np.isfinite([*fit.center, fit.radius, *fit.center_stderr, fit.radius_stderr, fit.rms]).all()


def test_five_degree_arcs_are_refused_every_time():
    for noise in (0.0, 1e-5, 1e-4, 5e-4, 5e-3):
        points, _, _ = arcs(np.random.default_rng(8), 200, (5, 5), noise=noise)
        assert all(fit_circles(points).reason)


def test_a_batch_keeps_what_is_good_and_says_what_is_not():
    good = arcs(np.random.default_rng(9), 1, (90, 90))[0][0]
    fits = fit_circles([good, LINE, good[:5], good[::2]])
    assert [bool(reason) for reason in fits.reason] == [False, True, True, False]
    assert len(fits) == 4
    assert fits[0].radius == pytest.approx(2.0, abs=0.01)
    assert np.isnan(fits.radius[1])
    with pytest.raises(NotAnArcError, match="not an arc: 5 points"):
        fits[2]
    assert len(fit_circles([])) == 0


@pytest.mark.parametrize("points", [np.ones(3), np.ones((3, 3)), [["a", "b"]], np.ones((2, 3, 2))])
def test_points_of_another_shape_are_an_input_error(points):
    with pytest.raises(InputError, match="points"):
        fit_circle(points)


def test_unknown_method_is_an_input_error():
    with pytest.raises(InputError, match="unknown circle fit"):
        fit_circle(LINE, "kasa")  # type: ignore[arg-type]


@pytest.mark.slow
def test_code_that_was_just_compiled_and_code_from_the_cache_give_the_same_numbers(tmp_path):
    # A function that is not inlined exists twice in the process that compiles, optimised alone and within its caller.
    code = (
        "import numpy as np, sys; from agvbench.calibration import fit_circles; r = np.random.default_rng(0);"
        "arcs = [np.column_stack([np.cos(a), np.sin(a)]) + r.normal(0.0, 3e-4, (len(a), 2))"
        " for a in (np.linspace(0.0, e, 60 + 7 * k) for k, e in enumerate(np.linspace(0.3, 5.0, 40)))];"
        "f = fit_circles(arcs); found = np.column_stack([f.center, f.radius, f.radius_stderr]);"
        "sys.stdout.buffer.write(found.tobytes())"
    )
    environment = {**os.environ, "AGVBENCH_CACHE": str(tmp_path)}
    first, second = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=environment).stdout
        for _ in range(2)
    )
    assert first == second
    assert len(first) == 40 * 4 * 8
