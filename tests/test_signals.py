"""Statistics of signals, against what is known of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agvbench.signals import robust_std
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
