"""Commands that follow each other quickly in small steps are merged, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.diagnosis.data.merged_commands import CommandMerging
from agvbench.types import NO_TARGET, Command, Commands, Floats, Frames, Run

NEUTRAL = Command(0.0, 0.0, 0.0)
MERGING = CommandMerging(np.array([1.0, 1.0, np.inf]), NEUTRAL)
MOST_S = 1.25e-4 * (1.0 + 1e-9)
"""Largest integral of a difference: a step over the whole range that is so late."""


def commands(t_s: Floats, drive: Floats, front: Floats) -> Commands:
    return Commands(t_s, drive, front, np.zeros(len(t_s)))


def integral(own: Commands, role: str, t_s: Floats) -> Floats:
    """Return the integral of a command from its beginning until `t_s`."""
    ends_s = np.append(own.t_s[1:], np.inf)
    held_s = np.clip(t_s[:, None], own.t_s, ends_s) - own.t_s
    return held_s @ getattr(own, role)


@st.composite
def driven_by_hand(draw: st.DrawFn) -> Commands:
    """Draw commands of a joystick: steps of all sizes after all times, through neutral and back."""
    rows = draw(st.lists(st.tuples(st.floats(1e-3, 0.3), st.floats(-0.1, 0.1), st.floats(-0.02, 0.02)), min_size=2))
    t_s, drive, front = np.array(rows).T
    drive[draw(st.lists(st.integers(0, len(rows) - 1)))] = 0.0
    return commands(np.cumsum(t_s), np.clip(drive, -0.5, 0.5), np.clip(np.cumsum(front), -0.5, 0.5))


@given(driven_by_hand())
def test_merged_commands_are_as_exact_as_time_stamps(own):
    merged = MERGING.merged(own, 0.0)
    assert {*merged.t_s} <= {*own.t_s}
    assert merged.t_s[0] == own.t_s[0]
    assert merged.at(-1) == own.at(-1) or own.at(-1) == own.at(-2)
    for role in ("drive", "front"):
        moved = integral(merged, role, own.t_s) - integral(own, role, own.t_s)
        np.testing.assert_array_less(np.abs(moved), MOST_S + 1e-12)
        at_begin = np.isin(own.t_s, merged.t_s)
        np.testing.assert_allclose(moved[at_begin], 0.0, atol=1e-12)


@given(driven_by_hand())
def test_neutral_stays_neutral_and_sides_stay_apart(own):
    merged = MERGING.merged(own, 0.0)
    at = np.searchsorted(merged.t_s, own.t_s, side="right") - 1
    for role in ("drive", "front"):
        assert np.array_equal(np.sign(getattr(merged, role)[at]), np.sign(getattr(own, role)))


@given(driven_by_hand())
def test_what_does_not_change_is_exact(own):
    held = Commands(own.t_s, np.full(len(own), 0.1), own.front, own.rear)
    assert {*MERGING.merged(held, 0.0).drive} == {0.1}


def test_a_slow_stick_costs_few_rows():
    t_s = np.arange(0.0, 10.0, 0.02)
    own = commands(t_s, np.full(len(t_s), 0.3), 0.4 * np.sin(0.5 * t_s))
    assert 5 * len(MERGING.merged(own, 0.0)) < 2 * len(own)


def test_commands_long_before_a_window_are_merged_for_longer():
    t_s = np.arange(0.0, 20.0, 0.02)
    own = commands(t_s, np.full(len(t_s), 0.3), 0.4 * np.sin(0.5 * t_s))
    all_inside, all_before = (MERGING.merged(own, begins_s) for begins_s in (0.0, 30.0))
    mixed = MERGING.merged(own, 10.0)
    assert 2 * len(all_before) < len(all_inside)
    assert np.count_nonzero(mixed.t_s > 9.0) == pytest.approx(np.count_nonzero(all_inside.t_s > 9.0), abs=2)
    assert np.count_nonzero(mixed.t_s < 7.0) == pytest.approx(np.count_nonzero(all_before.t_s < 7.0), abs=2)


@pytest.mark.parametrize("every_s", [0.05, 0.1, 0.5])
def test_steps_are_left_as_they_are(every_s):
    t_s = every_s * np.arange(20)
    own = commands(t_s, np.where(np.arange(20) % 2, 0.4, 0.2), np.linspace(-0.4, 0.5, 20))
    merged = MERGING.merged(own, 0.0)
    for role in ("t_s", "drive", "front", "rear"):
        np.testing.assert_array_equal(getattr(merged, role), getattr(own, role))


def test_ranges_are_those_of_all_runs():
    t_s = np.arange(2.0)
    runs = [
        Run("a", "", "", "", 0, NO_TARGET, 0.0, "ok", "", commands(t_s, t_s, -t_s), Frames.empty()),
        Run("b", "", "", "", 0, NO_TARGET, 0.0, "ok", "", commands(t_s, 3.0 * t_s, t_s), Frames.empty()),
    ]
    np.testing.assert_array_equal(CommandMerging.of(runs, NEUTRAL).ranges, [3.0, 2.0, np.inf])
