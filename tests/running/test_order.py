"""Order of runs: what drifts must fall on all conditions alike, and a shuffle must not hang on what else is driven."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.pytest_plugin.collection import ordered
from agvbench.running.configuration.settings import ORDERS

CELLS = [(t, c, r) for t in "1234" for c in ("uncalibrated", "calibrated") for r in range(1, 4)]


def drive_in(order, cells=CELLS, seed=1):
    return ordered(
        cells, order, seed=seed, phase=lambda cell: int(cell[0] != "1"), repeat=lambda cell: cell[2], name=str
    )


@pytest.mark.parametrize("order", ORDERS)
def test_every_order_drives_every_cell_once_and_calibration_first(order):
    driven = drive_in(order)
    assert Counter(driven) == Counter(CELLS)
    phases = [cell[0] != "1" for cell in driven]
    assert phases == sorted(phases)


def test_interleaved_drives_every_cell_once_before_any_twice():
    later = [cell for cell in drive_in("interleaved") if cell[0] != "1"]
    assert [cell[2] for cell in later] == [1] * 6 + [2] * 6 + [3] * 6


def test_blocked_is_the_thesis_flowchart():
    assert drive_in("blocked") == CELLS


@given(st.integers(0, 2**40), st.sets(st.sampled_from(CELLS), min_size=2))
def test_shuffle_hangs_on_seed_and_own_name_only(seed, subset):
    whole = [cell for cell in drive_in("shuffled", seed=seed) if cell in subset]
    assert whole == drive_in("shuffled", cells=sorted(subset), seed=seed)


def test_shuffles_of_two_seeds_differ():
    assert drive_in("shuffled", seed=1) != drive_in("shuffled", seed=2)
