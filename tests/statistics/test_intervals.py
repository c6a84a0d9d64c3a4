"""Bootstrap intervals, spreads and the multiplicity correction against independent references."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from statistics_samples import error_table

from agvbench.statistics import bias_and_spread
from agvbench.statistics.hypothesis_tests import (
    holm,
    holm_tarone,
    minimum_detectable_difference,
    rank_test,
    required_sample_size,
    tarone_testable,
)
from agvbench.statistics.intervals import average_difference_interval, median_difference_interval, median_interval
from agvbench.statistics.repeatability import spread

NOISES = {
    "normal": lambda rng, size: rng.normal(size=size),
    "heavy tails": lambda rng, size: rng.standard_t(3, size=size),
    "skewed": lambda rng, size: rng.exponential(size=size),
}


@pytest.mark.parametrize("noise", NOISES)
def test_median_difference_interval_covers_as_promised(noise):
    rng = np.random.default_rng(7)
    covered = [
        median_difference_interval(a, b + 3.0, resamples=400).covers(3.0)
        for a, b in (NOISES[noise](rng, (2, 10)) for _ in range(400))
    ]
    assert 0.92 <= np.mean(covered) <= 0.99


def test_intervals_are_the_same_every_time_and_agree_with_scipy():
    rng = np.random.default_rng(8)
    a, b = rng.normal(size=41), rng.normal(2.0, 1.0, size=51)
    ours = median_difference_interval(a, b)
    assert ours == median_difference_interval(a, b)
    peer = stats.bootstrap(
        (b, a),
        lambda x, y, axis: np.median(x, axis=axis) - np.median(y, axis=axis),
        method="percentile",
        rng=1,
        vectorized=True,
    ).confidence_interval
    assert ours[1:] == pytest.approx((peer.low, peer.high), abs=0.12)
    assert average_difference_interval([(a, b)]).estimate == ours.estimate
    assert median_interval(a).covers(float(np.median(a)))


def test_too_few_values_have_no_interval():
    interval = median_difference_interval(np.array([1.0, 2.0]), np.arange(10.0))
    assert interval.estimate == 3.0
    assert math.isnan(interval.low)
    assert math.isnan(spread(np.arange(4.0)).sd.low)


@pytest.mark.parametrize(("noise", "least"), [("normal", 0.92), ("heavy tails", 0.85)])
def test_bonett_interval_covers_the_standard_deviation(noise, least):
    rng = np.random.default_rng(9)
    truth = {"normal": 1.0, "heavy tails": math.sqrt(3.0)}[noise]
    covered = [spread(NOISES[noise](rng, 10)).sd.covers(truth) for _ in range(1000)]
    assert np.mean(covered) >= least


def test_bias_and_spread_are_kept_apart():
    rng = np.random.default_rng(10)
    table = bias_and_spread(error_table(lambda n: rng.normal(5.0, 2.0, n), repeats=400, trajectories=("1_forward",)))
    row = table[(table.condition == "calibrated") & (table.component == "Δs [mm]")].iloc[0]
    assert row.bias == pytest.approx(5.0, abs=0.4)
    assert row.sd == pytest.approx(2.0, rel=0.1)
    assert row.robust_sd == pytest.approx(2.0, rel=0.15)
    assert row.bias_low < row.bias < row.bias_high


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_holm_is_between_no_correction_and_bonferroni_and_keeps_order(p):
    adjusted = holm(p)
    assert all(x <= y <= min(1.0, x * len(p)) + 1e-12 for x, y in zip(p, adjusted, strict=True))
    order = np.argsort(p, kind="stable")
    assert np.all(np.diff(np.array(adjusted)[order]) >= 0)
    rejected = sum(value <= 0.05 for value in adjusted)
    step = 0
    for rank, value in enumerate(sorted(p)):
        if value * (len(p) - rank) > 0.05:
            break
        step += 1
    assert rejected == step


def test_tests_that_cannot_speak_cost_the_others_nothing():
    assert tarone_testable([0.05, 0.05, 1e-5, 1e-5], 0.01) == [False, False, True, True]
    assert holm_tarone([0.05, 0.05, 0.004, 0.5], [0.05, 0.05, 1e-5, 1e-5], 0.01) == [1, 1, 0.008, 0.5]
    assert tarone_testable([0.5], 0.01) == [False]


@pytest.mark.parametrize("repeats", [7, 10, 20, 60])
def test_the_smallest_visible_difference_is_found_about_nine_times_in_ten(repeats):
    alpha = 0.01 / 18
    shift = minimum_detectable_difference(1.0, repeats, repeats, alpha=alpha)
    rng = np.random.default_rng(repeats)
    a, b = rng.normal(size=(2, 500, repeats))
    found = [rank_test([(x, y + shift)]).p_greater <= alpha for x, y in zip(a, b, strict=True)]
    assert 0.85 <= np.mean(found) <= 0.95


def test_where_no_difference_is_visible():
    assert minimum_detectable_difference(1.0, 5, 5, alpha=1e-3) == math.inf
    assert required_sample_size(1e-3) == 7  # 1 / C(14, 7) = 1/3432, while 1 / C(12, 6) = 1/924
