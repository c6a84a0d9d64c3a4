"""Bounds against published values and closed forms, and the level of sequential rank-sum tests by simulation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, norm

from agvbench.statistics.hypothesis_tests import rank_test
from agvbench.statistics.repeats.group_sequential import (
    Spending,
    critical_values,
    crossing_probability,
    rank_sum_information,
    sequential_p,
    spent,
)

FIVE = tuple((k / 5, k / 5) for k in range(1, 6))
SPENDING = list(Spending)


@pytest.mark.parametrize(
    ("spending", "published"),
    [
        # Reboussin, DeMets, Kim and Lan (2000), two-sided 5 %: 2.5 % on each side.
        (Spending.OBRIEN_FLEMING, [4.8769, 3.3569, 2.6803, 2.2898, 2.0310]),
        (Spending.POCOCK, [2.4380, 2.4268, 2.4101, 2.3966, 2.3859]),
    ],
)
def test_bounds_are_the_published_ones(spending, published):
    assert critical_values(FIVE, 0.025, spending) == pytest.approx(published, abs=2e-3)


@pytest.mark.parametrize(
    ("critical", "level"),
    [
        # Jennison and Turnbull (2000), tables 2.1 and 2.3: five analyses, two-sided 5 %.
        ([2.413] * 5, 0.025),
        ([2.040 * np.sqrt(5 / k) for k in range(1, 6)], 0.025),
    ],
)
def test_constants_of_pocock_and_of_obrien_and_fleming_have_their_level(critical, level):
    assert crossing_probability([k / 5 for k in range(1, 6)], critical) == pytest.approx(level, rel=3e-3)


def test_one_analysis_is_the_usual_test():
    for spending in SPENDING:
        assert critical_values(((1.0, 1.0),), 0.01, spending) == pytest.approx([norm.isf(0.01)], abs=1e-6)
        for p in (0.3, 0.04, 1e-4):
            assert sequential_p([p], ((1.0, 1.0),), spending) == pytest.approx(p, rel=1e-6)


def test_two_analyses_are_a_bivariate_normal_probability():
    from scipy.stats import multivariate_normal

    share = 0.4
    first, second = critical_values(((share, share), (1.0, 1.0)), 0.025, Spending.CUBIC)
    assert norm.sf(first) == pytest.approx(0.025 * share**3, rel=1e-6)
    inside = multivariate_normal(cov=[[1.0, np.sqrt(share)], [np.sqrt(share), 1.0]]).cdf([first, second])
    assert 1.0 - inside == pytest.approx(0.025, rel=1e-3)


schedules = st.lists(st.floats(0.02, 1.0), min_size=1, max_size=5).map(
    lambda steps: tuple((float(t), float(t)) for t in np.cumsum(steps) / np.sum(steps))
)


@settings(max_examples=40)
@given(schedules, st.sampled_from(SPENDING), st.floats(1e-4, 0.2))
def test_the_level_is_spent_whatever_the_schedule(schedule, spending, level):
    critical = critical_values(schedule, level, spending)
    for k in range(1, len(schedule) + 1):
        planned = float(spent(np.array([level]), schedule[k - 1][1], spending)[0])
        crossed = crossing_probability([t for t, _ in schedule[:k]], critical[:k])
        assert crossed == pytest.approx(planned, rel=0.01, abs=1e-8)


# A new schedule takes a second, so that properties of p-values are tested on few.
few = st.sampled_from([FIVE, ((0.55, 0.55), (0.8, 0.8), (0.96, 0.96), (0.97, 1.0))])


@given(few, st.sampled_from(SPENDING), st.data())
def test_a_sequential_p_value_never_grows_and_is_not_below_that_of_one_analysis(schedule, spending, data):
    p_values = data.draw(st.lists(st.floats(1e-6, 1.0), min_size=len(schedule), max_size=len(schedule)))
    found = [sequential_p(p_values[:k], schedule[:k], spending) for k in range(1, len(schedule) + 1)]
    assert found == sorted(found, reverse=True)
    assert found[-1] >= min(p_values) * 0.999


@given(few, st.sampled_from(SPENDING), st.floats(1e-3, 0.1))
def test_a_sequential_p_value_is_at_most_a_level_where_its_bound_is_crossed(schedule, spending, level):
    critical = critical_values(schedule, level, spending)
    for k, z in enumerate(critical, start=1):
        if np.isfinite(z) and z < 8.0:
            others = [0.9] * (k - 1)
            assert sequential_p([*others, float(norm.sf(z + 0.02))], schedule[:k], spending) <= level
            assert sequential_p([*others, float(norm.sf(z - 0.02))], schedule[:k], spending) >= level * 0.999


def test_an_analysis_without_new_data_changes_nothing():
    twice = (FIVE[0], FIVE[1], FIVE[1], FIVE[2])
    critical = critical_values(twice, 0.025, Spending.CUBIC)
    assert np.isinf(critical[2])
    assert np.delete(critical, 2) == pytest.approx(critical_values(FIVE[:3], 0.025, Spending.CUBIC))


def test_rank_sums_against_a_fixed_sample_correlate_as_their_information_says():
    rng, n_a, sizes = np.random.default_rng(3), 6, (3, 8, 20)
    a, b = rng.standard_normal((40_000, n_a)), rng.standard_normal((40_000, sizes[-1]))
    pairs = np.cumsum((b[:, :, None] > a[:, None, :]).sum(axis=2), axis=1)
    measured = np.corrcoef([pairs[:, n - 1] for n in sizes])
    information = np.array([rank_sum_information(n_a, n) for n in sizes])
    expected = np.sqrt(np.minimum.outer(information, information) / np.maximum.outer(information, information))
    assert measured == pytest.approx(expected, abs=0.01)
    textbook = np.sqrt(3 / 20)  # of two samples that both grow
    assert abs(measured[0, 2] - textbook) > 0.1


@pytest.mark.parametrize("draw", ["standard_normal", "standard_cauchy"])
def test_a_sequential_rank_test_keeps_its_level(draw):
    rng, level, n_a, most, campaigns = np.random.default_rng(5), 0.05, 8, 12, 800
    shares = [rank_sum_information(n_a, n) / rank_sum_information(n_a, most) for n in range(3, most + 1)]
    schedule = tuple((share, share) for share in shares)
    rejected = naive = 0
    for _ in range(campaigns):
        a, b = getattr(rng, draw)(n_a), getattr(rng, draw)(most)
        p_values = [rank_test([(a, b[:n])]).p_greater for n in range(3, most + 1)]
        rejected += sequential_p(p_values, schedule, Spending.CUBIC) <= level
        naive += min(p_values) <= level
    highest = binom.ppf(0.999, campaigns, level)
    assert rejected <= highest
    assert naive > highest  # the same tests without the correction do not keep it
