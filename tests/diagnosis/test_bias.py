"""A bias that the predicted scatter of other groups hides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.residuals.bias_test import bias_p_value
from agvbench.diagnosis.residuals.residuals import PoseResiduals
from agvbench.diagnosis.selection.validation import Assessment

GROUP = np.repeat(np.arange(6), 4)


def ends(seed, bias_m):
    """Six groups of four repeats; the first scatters a hundred times as much as the others."""
    rng = np.random.default_rng(seed)
    scatter = np.where(GROUP == 0, 0.2, 0.002)
    return rng.normal(size=(24, 2)) * scatter[:, None] + np.where(GROUP > 0, bias_m, 0.0)[:, None]


def test_a_bias_is_found_beside_a_group_that_scatters():
    assert bias_p_value(ends(1, 0.01), GROUP) < 1e-3


def test_scatter_alone_is_no_bias():
    p_values = np.array([bias_p_value(ends(seed, 0.0), GROUP) for seed in range(200)])
    assert np.mean(p_values < 0.05) < 0.1
    assert np.mean(p_values < 0.5) == pytest.approx(0.5, abs=0.12)


@given(scale=st.floats(1e-3, 1e3), shift=st.integers(0, 20))
def test_neither_units_nor_numbers_of_groups_matter(scale, shift):
    assert bias_p_value(scale * ends(3, 0.0005), GROUP + shift) == bias_p_value(ends(3, 0.0005), GROUP)


def test_without_repeats_there_is_no_test():
    assert bias_p_value(ends(1, 0.01), np.arange(24)) is None


@pytest.mark.parametrize(("bias_mm", "bias", "expected"), [(5.0, 1e-4, True), (5.0, 0.2, False), (1.5, 1e-4, False)])
def test_only_a_bias_far_beyond_the_repeatability_is_a_lack_of_fit(bias_mm, bias, expected):
    path = np.full((24, 2, 3), 1e-3 * bias_mm / np.sqrt(2.0))
    path[..., 2] = 0.0
    after = PoseResiduals(path, np.ones((24, 2), dtype=bool), np.zeros(24), np.zeros(24))
    spread = dict.fromkeys(after.rms(), 1.0)
    assert Assessment(after, after, spread, spread, 0.5, bias).has_lack_of_fit is expected
    assert 1.5 < RESIDUAL.far_beyond_repeatability < 5.0
