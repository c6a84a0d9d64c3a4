"""Steps in series of nightly values: found where they were put, and rarely where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.statistics.steps.change_points import FEWEST, SHORTEST, find_steps

_SEEDS = range(60)


def _nights(seed, *, series=8, nights=60, correlation=0.0):
    """Return autoregressive noise of variance 1, half of it common to all series."""
    rng = np.random.default_rng(seed)
    added = np.sqrt(0.5) * (rng.normal(size=(series, nights)) + rng.normal(size=nights))
    values = added.copy()
    for night in range(1, nights):
        values[:, night] = correlation * values[:, night - 1] + np.sqrt(1.0 - correlation**2) * added[:, night]
    return values


@pytest.mark.slow
def test_a_step_is_found_on_its_night_and_its_interval_covers_it():
    near = covered = 0
    for seed in _SEEDS:
        values, night = _nights(seed), 15 + seed % 30
        values[2, night:] += 2.5
        steps = find_steps(values, alpha=0.05).of[2]
        near += any(abs(step.night - night) <= 1 for step in steps)
        covered += any(step.earliest <= night <= step.latest for step in steps)
    # 94 % and 97 % of a thousand; three standard errors below
    assert near >= 0.84 * len(_SEEDS)
    assert covered >= 0.88 * len(_SEEDS)


@pytest.mark.parametrize(("correlation", "most"), [(0.0, 0.05), (0.4, 0.08)])
@pytest.mark.slow
def test_series_without_a_step_rarely_have_one(correlation, most):
    found = [any(find_steps(_nights(seed, correlation=correlation), alpha=0.05).of) for seed in _SEEDS]
    assert np.mean(found) <= most + 3.0 * np.sqrt(most / len(_SEEDS))


def test_levels_of_several_steps_and_the_standard_deviation_about_them():
    values = 0.5 * _nights(3, series=1, nights=90)
    values[0, 30:60] += 5.0
    found = find_steps(values, alpha=0.05)
    up, down = found.of[0]
    assert (up.night, down.night) == (30, 60)
    assert up.change == pytest.approx(5.0, abs=0.4)
    assert down.change == pytest.approx(-5.0, abs=0.4)
    assert found.sd[0] == pytest.approx(0.5, rel=0.25)


def test_a_large_step_does_not_hide_a_small_one():
    values = _nights(5, series=1, nights=90)
    values[0, 30:] += 100.0
    values[0, 60:] += 3.0
    assert [abs(step.night - at) <= 1 for step, at in zip(find_steps(values, alpha=0.05).of[0], (30, 60), strict=True)]


def test_nights_without_a_value_keep_their_numbers():
    values = 0.1 * _nights(7, series=2, nights=40)
    values[0, 20:] += 3.0
    values[0, 15:20] = np.nan
    (step,) = find_steps(values, alpha=0.05).of[0]
    assert (step.last_before, step.earliest, step.night, step.latest) == (14, 20, 20, 20)


def test_a_single_night_is_no_step():
    values = 0.1 * _nights(9, series=1, nights=40)
    values[0, 20] += 3.0
    assert find_steps(values, alpha=0.05).of == ((),)


def test_equal_nights_have_no_step_and_their_program_one():
    """Simulations with one seed repeat themselves to the last digit, until the program changes."""
    same, changed = np.full((2, 30), 12.3)
    changed[11:] = 12.4
    none, one = find_steps(np.vstack([same, changed]), alpha=0.05).of
    assert none == ()
    assert [(step.earliest, step.night, step.latest) for step in one] == [(11, 11, 11)]


def test_too_few_nights_are_not_tested():
    values = np.zeros((1, FEWEST - 1))
    values[0, 4:] = 9.0
    found = find_steps(values, alpha=0.05)
    assert found.of == ((),)
    assert np.isnan(found.sd[0])


@given(
    st.integers(0, 1000),
    st.sampled_from([1e-3, 1.0, 1e6]),
    st.floats(-1e3, 1e3, allow_nan=False),
    st.integers(SHORTEST, 20),
)
def test_unit_and_origin_of_the_values_do_not_matter(seed, scale, origin, first):
    values = _nights(seed, series=2, nights=30)
    values[0, first:] += 4.0
    moved = find_steps(scale * (values + origin), alpha=0.05)
    steps = find_steps(values, alpha=0.05)
    assert [[s.night for s in of] for of in moved.of] == [[s.night for s in of] for of in steps.of]
    for step in (step for of in steps.of for step in of):
        assert step.last_before < step.earliest <= step.night <= step.latest
