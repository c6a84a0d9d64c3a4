"""The equivalence test keeps its level where the truth is at the margin, and finds what is well within."""

import math

import numpy as np
import pandas as pd
import pytest

from agvbench.statistics.equivalence import Bias, equivalence, equivalences


def shares(bias_sds, n, draws=2000):
    rng = np.random.default_rng(7)
    verdicts = [equivalence(3.0 * (rng.standard_normal(n) + bias_sds)).verdict for _ in range(draws)]
    return {verdict: verdicts.count(verdict) / draws for verdict in Bias}


@pytest.mark.parametrize("n", [5, 30])
@pytest.mark.parametrize("bias_sds", [1.0, -1.0])
def test_at_the_margin_each_answer_is_given_wrongly_in_one_of_twenty(bias_sds, n):
    said = shares(bias_sds, n)
    assert said[Bias.WITHIN] == pytest.approx(0.05, abs=0.015)
    assert said[Bias.BEYOND] == pytest.approx(0.05, abs=0.015)


def test_thirty_repeats_find_a_small_bias_within_and_a_large_one_beyond():
    assert shares(0.3, 30, 500)[Bias.WITHIN] > 0.95
    assert shares(2.0, 30, 500)[Bias.BEYOND] > 0.95


def test_few_repeats_say_nothing():
    assert equivalence(np.array([0.1, -0.1])).verdict is Bias.INCONCLUSIVE
    nothing = equivalence(np.array([]))
    assert nothing.verdict is Bias.INCONCLUSIVE
    assert math.isnan(nothing.bias)


def test_without_scatter_only_no_bias_is_within():
    assert equivalence(np.zeros(4)).verdict is Bias.WITHIN
    assert equivalence(np.full(4, 1e-6)).verdict is Bias.BEYOND


def test_scale_does_not_matter():
    values = np.random.default_rng(1).normal(0.4, 1.0, 12)
    a, b = equivalence(values), equivalence(-1e3 * values)
    assert b.p_within == pytest.approx(a.p_within, rel=1e-9)
    assert b.bias == pytest.approx(-1e3 * a.bias)


def test_a_table_of_errors_by_trajectory():
    table = {"trajectory": ["a", "a", "a", "a", "b"], "condition": ["x", "x", "x", "y", "y"]}
    table |= {"along_mm": [1.0, -1.0, 0.0, 50.0, 1.0], "delta_heading_deg": [5.0, 5.1, 4.9, 0.0, 0.0]}
    table |= {"across_mm": [60.0, 61.0, 59.0, 0.0, 0.0], "delta_s_mm": [1.0, -1.0, 0.0, 50.0, 1.0]}
    table |= {"status": ["ok"] * 5, "problem": [""] * 5}
    found = equivalences(pd.DataFrame(table), "x")
    assert set(found) == {("a", "along_mm"), ("a", "across_mm"), ("a", "delta_heading_deg")}
    assert found["a", "along_mm"].bias == 0.0
    assert found["a", "across_mm"].verdict is Bias.BEYOND
    assert found["a", "delta_heading_deg"].verdict is Bias.BEYOND
    assert found["a", "delta_heading_deg"].stderr == pytest.approx(0.1 / math.sqrt(3))
