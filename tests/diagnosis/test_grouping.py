from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import NEUTRAL, NEUTRAL_COMMAND, experiments

from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data.splits import folds, group_runs, split_runs, with_other_validation
from agvbench.errors import FitError
from agvbench.types import NO_TARGET, Commands, Frames, Run


def bare_runs() -> list[Run]:
    return [
        Run(f"{k}-{r}", name, "", "calibrated", r, NO_TARGET, 0.0, "ok", "", commands, Frames.empty())
        for k, (name, commands, repeats) in enumerate(experiments())
        for r in range(repeats)
    ]


def test_repeats_share_a_group_and_nothing_else_does():
    runs = bare_runs()
    group = group_runs(runs)
    told = [(*c.t_s, *c.drive, *c.front, *c.rear) for c in (run.commands for run in runs)]
    same = np.array([[a == b for b in told] for a in told])
    assert np.array_equal(group[:, None] == group[None, :], same)


def test_times_that_jitter_by_milliseconds_are_the_same_commands():
    runs = bare_runs()[:1]
    c = runs[0].commands
    late = Commands(c.t_s + np.array([0.0, 0.004, 0.009]), c.drive, c.front, c.rear)
    longer = Commands(c.t_s + np.array([0.0, 0.0, 0.5]), c.drive, c.front, c.rear)
    three = [runs[0], dataclasses.replace(runs[0], commands=late), dataclasses.replace(runs[0], commands=longer)]
    assert group_runs(three).tolist() == [0, 0, 1]


@given(seed=st.integers(0, 50))
def test_what_is_set_aside_is_whole_groups_whose_levels_were_driven_elsewhere_too(seed):
    runs = bare_runs()
    group = group_runs(runs)
    split = split_runs(runs, group, NEUTRAL_COMMAND, seed)
    held = ~split.training
    assert np.array_equal(held, split.validation | split.test)
    assert not set(group[split.validation]) & set(group[split.test])
    assert abs(split.validation.sum() - split.test.sum()) <= 3
    assert 0 < held.sum() <= 1.1 * DATA.test_share * len(runs)
    assert not set(group[held]) & set(group[~held])
    for role in ("drive", "front", "rear"):
        kept = {float(v) for run, out in zip(runs, held, strict=True) if not out for v in getattr(run.commands, role)}
        aside = {float(v) for run, out in zip(runs, held, strict=True) if out for v in getattr(run.commands, role)}
        assert aside <= kept | {NEUTRAL}


@given(seed=st.integers(0, 50))
def test_where_every_group_has_levels_of_its_own_near_ones_remain_and_no_map_is_extrapolated(seed):
    rng, runs = np.random.default_rng(seed), bare_runs()
    group = group_runs(runs)
    own = [{role: rng.uniform(-20.0, 20.0) for role in ("drive", "front", "rear")} for _ in range(int(group.max()) + 1)]
    for i, run in enumerate(runs):
        levels = {role: getattr(run.commands, role) for role in own[group[i]]}
        moved = {role: np.where(v == NEUTRAL, v, v + own[group[i]][role]) for role, v in levels.items()}
        runs[i] = dataclasses.replace(run, commands=dataclasses.replace(run.commands, **moved))
    held = ~split_runs(runs, group, NEUTRAL_COMMAND, seed).training
    assert held.sum() >= 0.5 * DATA.test_share * len(runs)
    assert not set(group[held]) & set(group[~held])
    for role in ("drive", "front", "rear"):
        aside, kept = (
            np.unique(
                np.concatenate(
                    [getattr(run.commands, role) for run, out in zip(runs, held.tolist(), strict=True) if out is one]
                )
            )
            for one in (True, False)
        )
        assert kept[0] <= aside[0]
        assert aside[-1] <= kept[-1]
        assert np.abs(aside[:, None] - kept).min(axis=1).max() <= np.ptp(kept) / 15.0


@given(seed=st.integers(0, 50))
def test_other_validation_runs_leave_the_test_and_every_level_in_the_training(seed):
    runs = bare_runs()
    group = group_runs(runs)
    split = split_runs(runs, group, NEUTRAL_COMMAND, seed)
    other = with_other_validation(split, runs, group, NEUTRAL_COMMAND, seed)
    assert np.array_equal(other.test, split.test)
    assert np.array_equal(other.training, ~(other.validation | other.test))
    assert other.validation.any()
    assert other.training[split.validation].all()
    assert not set(group[other.validation]) & set(group[other.training])
    for role in ("drive", "front", "rear"):
        at = [{float(v) for v in getattr(run.commands, role)} for run in runs]
        fitted = set().union(*(at[i] for i in np.flatnonzero(other.training)))
        assert set().union(*at) <= fitted | {NEUTRAL}


def test_validation_runs_that_a_campaign_names_stay():
    runs = [dataclasses.replace(run, split="fit") for run in bare_runs()]
    runs[0] = dataclasses.replace(runs[0], split="held_out")
    runs[1] = dataclasses.replace(runs[1], split="validation")
    group = group_runs(runs)
    assert with_other_validation(split_runs(runs, group, NEUTRAL_COMMAND, 0), runs, group, NEUTRAL_COMMAND, 0) is None


@given(seed=st.integers(0, 200))
def test_most_of_what_steers_while_it_drives_stays_to_be_fitted(seed):
    runs = bare_runs()
    split = split_runs(runs, group_runs(runs), NEUTRAL_COMMAND, seed)
    steps = np.array([run.experiment == "step" for run in runs])
    assert steps.sum() > 0
    assert (~split.training & steps).sum() <= steps.sum() / 3.0
    assert abs((split.validation & steps).sum() - (split.test & steps).sum()) <= 3


def changing(name: str, fronts: list[float], repeats: int = 4) -> list[Run]:
    """Return runs whose front command changes while they drive, and that steer back at rest."""
    count = len(fronts)
    t_s, neutral = np.arange(count + 2.0), np.full(count + 2, NEUTRAL)
    drive = np.r_[np.full(count, 1800.0), NEUTRAL, NEUTRAL]
    commands = Commands(t_s, drive, np.r_[fronts, fronts[-1], NEUTRAL], neutral)
    return [
        Run(f"{name}-{r}", name, "", "calibrated", r, NO_TARGET, 0.0, "ok", "", commands, Frames.empty())
        for r in range(repeats)
    ]


@pytest.mark.parametrize("seed", range(20))
def test_returns_to_neutral_while_driving_are_never_in_the_test_alone(seed):
    """Only they show a backlash: in every other run the side from which an angle is reached has the command's sign."""
    runs = [run for k in range(12) for run in changing(f"slalom-{k}", [1300.0, 1700.0, 1300.0, 1700.0][: 2 + k % 3])]
    runs += [run for level in (1300.0, 1700.0) for run in changing(f"arc-{level}", [level])]
    runs += changing("lane change", [NEUTRAL, 1300.0, 1700.0, NEUTRAL]) + changing("jog", [NEUTRAL, 1700.0, NEUTRAL])
    split = split_runs(runs, group_runs(runs), NEUTRAL_COMMAND, seed)
    fitted = {run.experiment for run, fits in zip(runs, split.training, strict=True) if fits}
    assert fitted & {"lane change", "jog"}
    assert not split.training.all()


@pytest.mark.parametrize("seed", range(20))
def test_both_ends_of_a_commands_range_stay_in_two_groups_of_the_training(seed):
    """A single combination with other commands does not determine the end of a map."""
    sides = (1300.0, 1400.0, 1600.0, 1700.0)
    runs = [run for k in range(3) for level in sides for run in changing(f"{level}-{k}", [level] * (k + 1))]
    group = group_runs(runs)
    split = split_runs(runs, group, NEUTRAL_COMMAND, seed)
    for training in (split.training, with_other_validation(split, runs, group, NEUTRAL_COMMAND, seed).training):
        for end in (1300.0, 1700.0):
            at_end = np.array([end in run.commands.front for run in runs])
            assert len({*group[at_end & training]}) >= 2
    assert split.test.any()


@pytest.mark.parametrize("seed", range(20))
def test_an_end_that_only_two_groups_have_keeps_both_where_others_can_be_drawn(seed):
    levels = [1300.0, 1700.0] * 2 + [1400.0, 1500.0, 1600.0] * 6
    runs = [run for k, level in enumerate(levels) for run in changing(f"{level}-{k}", [level] * (1 + k // 3))]
    split = split_runs(runs, group_runs(runs), NEUTRAL_COMMAND, seed)
    at_end = np.array([bool({1300.0, 1700.0} & {*run.commands.front}) for run in runs])
    assert split.training[at_end].all()
    assert (~split.training).sum() >= 0.75 * DATA.test_share * len(runs)


def test_the_campaigns_own_split_is_kept():
    runs = [dataclasses.replace(r, split="held_out" if i % 3 == 0 else "fit") for i, r in enumerate(bare_runs())]
    split = split_runs(runs, group_runs(runs), NEUTRAL_COMMAND, 0)
    assert split.test.tolist() == [i % 3 == 0 for i in range(len(runs))]
    assert 0 < split.validation.sum() < 0.15 * len(runs)
    assert not (split.validation & split.test).any()
    named = [dataclasses.replace(r, split=name) for r, name in zip(runs, split.names, strict=True)]
    assert split_runs(named, group_runs(named), NEUTRAL_COMMAND, 5).names == split.names


def test_of_few_runs_the_test_is_made_first():
    few = [dataclasses.replace(r, run_id=str(i)) for i, r in enumerate(bare_runs()[:1] * 4)]
    split = split_runs(few, group_runs(few), NEUTRAL_COMMAND, 0)
    assert (split.training.sum(), split.validation.sum(), split.test.sum()) == (3, 0, 1)
    more = [dataclasses.replace(few[0], run_id=str(i)) for i in range(8)]
    split = split_runs(more, group_runs(more), NEUTRAL_COMMAND, 0)
    assert (split.training.sum(), split.validation.sum(), split.test.sum()) == (6, 1, 1)


def test_a_split_that_leaves_nothing_to_fit_is_one_line():
    runs = [dataclasses.replace(r, split="held_out") for r in bare_runs()]
    with pytest.raises(FitError, match="must name training runs and test runs"):
        split_runs(runs, group_runs(runs), NEUTRAL_COMMAND, 0)


@given(group=st.lists(st.integers(0, 12), min_size=5, max_size=60), seed=st.integers(0, 9))
def test_a_group_is_in_one_fold(group, seed):
    numbers = np.array(group)
    fold = folds(numbers, 4, seed)
    assert all(len(set(fold[numbers == g])) == 1 for g in set(group))
    assert np.array_equal(fold, folds(numbers, 4, seed))
