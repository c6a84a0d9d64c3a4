"""A campaign whose steering also swings, a level every twentieth of a second, and is stepped to levels of its own."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import NEUTRAL, NEUTRAL_COMMAND, InMemory, Tiny, campaign_runs, drive

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.model.nodal_maps import nodal_maps, select_levels
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.types import NO_TARGET, Commands, Pose, Run

MOST = 40


def periodic_disturbance(drive_us, size_us, period_s):
    t = np.arange(0.4, 6.0, 0.05)
    wave = np.round(size_us * np.sin(math.tau * (t - 0.4) / period_s))
    front, rear = NEUTRAL - wave, NEUTRAL + 0.5 * np.round(wave)
    rest = [NEUTRAL]
    return Commands(
        np.r_[0.0, t, 6.0], np.r_[rest, np.full(len(t), drive_us), rest], np.r_[rest, front, front[-1:]],
        np.r_[rest, rear, rear[-1:]],
    )  # fmt: skip


def stepped(rng):
    t = np.r_[0.0, 0.4 + 0.85 * np.arange(7)]
    front, rear = (np.round(rng.uniform(1180.0, 1820.0, 7)) for _ in range(2))
    speeds = np.round(NEUTRAL + rng.choice([-1.0, 1.0], 6) * rng.uniform(120.0, 500.0, 6))
    return Commands(t, np.r_[NEUTRAL, speeds, NEUTRAL], np.r_[front[0], front], np.r_[rear[0], rear])


def swinging(tiny):
    """The usual campaign, and three repeats each of two slaloms and six ways from level to level."""
    rng = np.random.default_rng(5)
    ways = [
        periodic_disturbance(900.0, 260.0, 1.6),
        periodic_disturbance(2100.0, 330.0, 2.3),
        *(stepped(rng) for _ in range(6)),
    ]
    runs = campaign_runs(tiny)
    for i, commands in enumerate(ways * 3):
        start = Pose(*rng.uniform(-0.7, 0.7, 2), rng.uniform(-math.pi, math.pi))
        started_s = 3700.0 + 20.0 * i
        frames = drive(tiny, commands, start, started_s, rng)
        name, repeat = f"way-{i % len(ways)}", 1 + i // len(ways)
        runs.append(
            Run(f"{name}-{repeat}", "step", "", "", repeat, NO_TARGET, started_s, "ok", "tiny", commands, frames)
        )
    return runs


@pytest.mark.slow
def test_nothing_hidden_is_adequate_and_the_maps_are_as_they_are():
    runs = swinging(Tiny())
    assert len({c for run in runs for c in run.commands.front}) > 2 * MOST
    found = diagnose(InMemory(runs))
    assert (found.verdict, found.effects) == (Verdict.ADEQUATE, ())
    assert float(found.model.front(1240.0)) == pytest.approx(0.364, abs=0.01)


@pytest.mark.slow
def test_a_lag_is_found_beside_it():
    found = diagnose(InMemory(swinging(Tiny(steering_lag_s=0.12))))
    assert found.verdict is Verdict.NAMED
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    lag = found.effects[0].parameters["time_constant_s"]
    assert lag.value == pytest.approx(0.12, abs=max(3.0 * lag.stderr, 0.002))


def test_a_value_lies_at_every_level_that_was_held():
    maps = nodal_maps(swinging(Tiny()), NEUTRAL_COMMAND)
    assert {1000.0, 1150.0, 1300.0, 1400.0, 1600.0, 1700.0, 1850.0, 2000.0} <= set(maps.nodes["front"])
    assert all(len(nodes) <= MOST for nodes in maps.nodes.values())


@given(
    st.lists(st.integers(1000, 2000), min_size=2, max_size=150, unique=True).map(sorted),
    st.integers(0, 2**32 - 1),
)
def test_some_of_many_levels_reach_from_end_to_end_without_wide_gaps(levels, seed):
    levels = np.array(levels, dtype=np.float64)
    held_s = np.where(np.random.default_rng(seed).random(len(levels)) < 0.1, 1.0, 0.05)
    nodes = select_levels(levels, held_s)
    assert np.all(np.diff(nodes) > 0.0)
    assert set(nodes) <= set(levels)
    assert (nodes[0], nodes[-1]) == (levels[0], levels[-1])
    assert len(nodes) <= MOST
    assert set(levels[held_s > 0.5]) <= set(nodes)
    away = np.abs(levels[:, None] - nodes).min(axis=1)
    assert away.max() <= np.ptp(levels) / 15.0 or len(nodes) == MOST


def test_a_gain_is_one_of_fit_and_of_prediction():
    def model(fit, predicted):
        return ScoredModel((), SimpleNamespace(total_loss=fit, prior=SimpleNamespace(loss=0.0)), np.array([predicted]))

    assert model(-10.0, -50.0).gain_over(model(-8.0, -20.0)) == 2.0
    assert model(-90.0, -50.0).gain_over(model(-8.0, -20.0)) == 30.0


def test_levels_that_are_only_passed_have_no_value_beside_held_ones():
    runs = [run for run in campaign_runs(Tiny(), steps=False) if run.experiment.startswith("steering")]
    passed = np.array([1310.0, 1320.0, 1330.0, 1340.0])
    sweep = Commands(
        np.array([0.0, 0.4, 0.45, 0.5, 0.55, 2.0]), np.r_[NEUTRAL, np.full(4, 900.0), NEUTRAL],
        np.r_[1300.0, passed, 1300.0], np.full(6, NEUTRAL),
    )  # fmt: skip
    nodes = nodal_maps([*runs, dataclasses.replace(runs[0], commands=sweep)], NEUTRAL_COMMAND).nodes["front"]
    # The last level is held until the vehicle stops.
    assert not {*passed[:3]} & {*nodes}
    assert {1000.0, 1300.0, 1340.0, 1700.0} <= {*nodes}
