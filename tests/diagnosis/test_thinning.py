"""Causes are looked for in some of many repeats, and measured in all."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import Tiny

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.selection.subsampling import subsample_repeats

GROUPS = st.lists(st.integers(0, 12), min_size=1, max_size=200).map(np.array)


@given(GROUPS, st.integers(1, 250))
def test_every_command_stays_with_a_repeat_and_no_more_runs_than_enough(group, most):
    chosen = subsample_repeats(group, most)
    sizes, kept = np.bincount(group), np.bincount(group[chosen], minlength=group.max() + 1)
    assert np.all(kept >= np.minimum(sizes, 2))
    assert chosen.sum() <= max(most, np.minimum(sizes, 2).sum())
    if len(group) <= most:
        assert chosen.all()


@given(st.integers(2, 60), st.integers(2, 40))
def test_what_is_kept_of_a_group_is_spread_over_the_session(size, most):
    at = np.flatnonzero(subsample_repeats(np.zeros(size, dtype=np.int64), most))
    assert at[0] == 0
    assert at[-1] == size - 1
    assert np.ptp(np.diff(at)) <= 1


@pytest.mark.slow
def test_causes_found_in_some_runs_are_measured_in_all(tiny_campaign, monkeypatch):
    campaign = tiny_campaign(Tiny(steering_lag_s=0.15))
    whole = diagnose(campaign)
    module = importlib.import_module("agvbench.diagnosis.runs_from_rest")
    monkeypatch.setattr(module, "DATA", replace(DATA, max_selection_runs=70))
    said: list[str] = []
    found = diagnose(campaign, on_progress=said.append)
    assert found.verdict is Verdict.NAMED
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    assert found.provenance["searched_runs"] < found.provenance["fit_runs"] == whole.provenance["fit_runs"]
    assert any("refitted to all" in line for line in said)
    few, all_of_them = (each.effects[0].parameters["time_constant_s"] for each in (found, whole))
    # The same runs are fitted in the end, and only the way there was another.
    assert few.value == pytest.approx(all_of_them.value, abs=0.05 * all_of_them.stderr)
    assert few.stderr == pytest.approx(all_of_them.stderr, rel=0.02)
