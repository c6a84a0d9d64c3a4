from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from agvbench.statistics.hypothesis_tests import rank_test

small = st.lists(st.integers(0, 6).map(float), min_size=1, max_size=5)


def brute_force(strata):
    """P(U ≥ observed) and P(U ≤ observed) over every way to deal the pooled values out."""

    def u(a, b):
        return sum((y > x) + 0.5 * (y == x) for x in a for y in b)

    sums = np.zeros(1)
    for a, b in strata:
        pooled = a + b
        dealt = []
        for chosen in combinations(range(len(pooled)), len(b)):
            rest = [v for i, v in enumerate(pooled) if i not in chosen]
            dealt.append(u(rest, [pooled[i] for i in chosen]))
        sums = np.add.outer(sums, dealt).ravel()
    observed = sum(u(a, b) for a, b in strata)
    return np.mean(sums >= observed - 1e-9), np.mean(sums <= observed + 1e-9)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(small, small), min_size=1, max_size=2))
def test_p_values_are_those_of_counting_every_deal_ties_and_strata_included(strata):
    test = rank_test([(np.array(a), np.array(b)) for a, b in strata])
    greater, less = brute_force(strata)
    assert test.p_greater == pytest.approx(greater)
    assert test.p_less == pytest.approx(less)
    assert test.minimum_p <= min(test.p_greater, test.p_less) + 1e-12


@pytest.mark.parametrize(("n", "m"), [(5, 5), (10, 10), (7, 20), (50, 50)])
def test_agrees_with_scipy_without_ties(n, m):
    rng = np.random.default_rng(n)
    a, b = rng.normal(size=n), rng.normal(0.7, 1.0, size=m)
    test = rank_test([(a, b)])
    for alternative, ours in (("greater", test.p_greater), ("less", test.p_less)):
        assert ours == pytest.approx(stats.mannwhitneyu(b, a, alternative=alternative, method="exact").pvalue)


def test_large_samples_take_the_normal_approximation_that_scipy_takes():
    rng = np.random.default_rng(3)
    a, b = rng.integers(0, 50, 400).astype(float), rng.integers(2, 52, 300).astype(float)
    test = rank_test([(a, b)])
    peer = stats.mannwhitneyu(b, a, alternative="greater", method="asymptotic")
    assert test.p_greater == pytest.approx(peer.pvalue, rel=0.02)


def test_the_normal_approximation_joins_the_exact_distribution_without_a_step():
    rng = np.random.default_rng(4)
    strata = [(rng.normal(size=12), rng.normal(0.4, 1.0, size=12)) for _ in range(69)]
    exact = rank_test(strata)
    wide = rank_test([*strata, (rng.normal(size=12), rng.normal(0.4, 1.0, size=12))])
    assert 0.01 < wide.p_greater / exact.p_greater < 100
    assert abs(wide.superiority - exact.superiority) < 0.02


def test_constant_and_empty_samples_say_nothing():
    same = np.full(6, 2.0)
    assert rank_test([(same, same)]).minimum_p == 1.0
    assert rank_test([(same, np.empty(0))]).p_greater == 1.0
    assert rank_test([]).superiority == 0.5
    huge = np.full(200, 1.0)
    assert rank_test([(huge, huge)]).p_greater == 1.0
