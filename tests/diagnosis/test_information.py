"""Information in the few parameters that each run depends on, against whole matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.diagnosis.estimation.likelihood import Information


@st.composite
def runs(draw):
    """Draw runs that each depend on some parameters: how they do (R, P, P), and the same with zeros left out."""
    count, some, depends = draw(st.integers(1, 8)), draw(st.integers(1, 6)), draw(st.integers(1, 8))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    own = np.array([rng.permutation(count)[: min(depends, count)] for _ in range(some)])
    slopes = rng.normal(size=(*own.shape, 3))
    blocks = slopes @ slopes.transpose(0, 2, 1)
    whole = np.zeros((some, count, count))
    for run, (numbers, block) in enumerate(zip(own, blocks, strict=True)):
        whole[run][np.ix_(numbers, numbers)] = block
    return whole, Information(own, blocks, count)


@given(runs())
def test_sums_and_forms_are_those_of_whole_matrices(drawn):
    whole, information = drawn
    np.testing.assert_array_equal(information.dense(), whole)
    np.testing.assert_array_equal(information.total, whole.sum(axis=0))
    move = np.arange(1.0, 1.0 + information.count)
    assert information.along(move) == pytest.approx(np.einsum("rij,i,j->r", whole, move, move), rel=1e-12)


@given(runs(), st.integers(0, 63))
def test_a_sum_over_some_runs_leaves_the_others_out(drawn, bits):
    whole, information = drawn
    some = (bits >> np.arange(len(whole))) & 1 == 1
    np.testing.assert_array_equal(information.total_of(some), whole[some].sum(axis=0))
