"""Statistics of signals, against what is known of them."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import numpy as np
import pytest

from agvbench.signals import best_chain, robust_std
from agvbench.types import wrap_angle


def test_a_robust_standard_deviation_is_that_of_the_noise_beside_outliers():
    noise = np.random.default_rng(0).normal(0.0, 0.3, 4000)
    noise[:400] += 50.0
    assert robust_std(noise) == pytest.approx(0.3, rel=0.2)
    assert robust_std(noise[400:]) == pytest.approx(0.3, rel=0.04)


def test_angles_are_wrapped_in_an_array_as_they_are_one_by_one():
    angles = np.array([-9.0, -math.pi, -0.1, 0.0, 3.0, math.pi, 7.0, 3.0 * math.pi])
    wrapped = wrap_angle(angles)
    assert wrapped.tolist() == [wrap_angle(float(a)) for a in angles]
    assert np.all((wrapped > -math.pi) & (wrapped <= math.pi))
    np.testing.assert_allclose(np.cos(wrapped), np.cos(angles), atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_the_best_chain_is_the_best_of_all_chains(seed):
    rng = np.random.default_rng(seed)
    score, follows = rng.integers(1, 100, 8), rng.random((8, 8)) < 0.4

    def total(chosen):
        near = all(follows[a, b] and b - a <= 3 for a, b in pairwise(chosen))
        return score[list(chosen)].sum() if near else 0

    found = best_chain(score, lambda before, piece: follows[before, piece], 3)
    assert total(found) == max(total(c) for count in range(1, 9) for c in combinations(range(8), count))
