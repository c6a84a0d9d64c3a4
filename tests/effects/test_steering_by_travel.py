"""Hysteresis of the steering: the equation of Dahl in steps, its limits, and what of it a run shows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.diagnosis.terms import SteeringByTravel
from agvbench.effects import state as s

HALF_RAD, SHARE = 0.02, 0.4
TARGETS = [0.3, 0.1, 0.15, 0.15, -0.4, -0.39, 0.0]


def under(targets: list[float], half_rad: float = HALF_RAD, share: float = SHARE) -> list[tuple[float, float]]:
    """Return the angles of both axles under each target of the front axle; the rear one has the opposite targets."""
    state, found = np.zeros(s.SIZE), []
    for target in targets:
        state[s.FRONT_AIM], state[s.REAR_AIM] = target, -target
        SteeringByTravel.aim(state, half_rad, share)
        found.append((float(state[s.FRONT_AIM]), float(state[s.REAR_AIM])))
    return found


def in_steps(targets: list[float], steps: int = 20000) -> list[float]:
    """Integrate the friction of the linkage from target to target: ``dF = k (dδ − |dδ| F / most)``."""
    at = force = 0.0
    found = []
    for target in targets:
        step = (target - at) / steps
        for _ in range(steps):
            force += 0.5 * SHARE * (step - abs(step) * force / HALF_RAD)
        at = target
        found.append(target - force)
    return found


def test_the_angles_are_those_of_an_integration() -> None:
    found = under(TARGETS)
    np.testing.assert_allclose([front for front, _ in found], in_steps(TARGETS), atol=2e-6)
    np.testing.assert_allclose([rear for _, rear in found], [-front for front, _ in found])


@given(st.lists(st.floats(-0.7, 0.7), min_size=1, max_size=8), st.floats(0.01, 1.0))
def test_an_axle_lags_behind_by_no_more_than_half_the_width(targets: list[float], share: float) -> None:
    for target, (front, _) in zip(targets, under(targets, share=share), strict=True):
        assert abs(target - front) <= HALF_RAD + 1e-12


def test_no_axle_moves_backward_and_right_after_a_reversal_a_share_is_lost() -> None:
    there, back = 9.0, 9.0 - 1e-6
    for share in (0.2, 1.0):
        (before, _), (after, _) = under([there, back], share=share)
        lost = 1.0 - (before - after) / (there - back)
        assert lost == pytest.approx(share, abs=2e-3)


def test_a_long_way_has_the_same_end_as_two_parts_of_it() -> None:
    assert under([0.2, 0.5])[-1] == pytest.approx(under([0.5])[-1])


def test_the_same_command_again_changes_nothing() -> None:
    assert under([0.2, 0.2, 0.2])[-1] == under([0.2])[-1]


def test_after_long_ways_it_is_an_offset_against_the_way() -> None:
    (front, _) = under([-9.0, 0.1 + 9.0, 0.1])[-1]
    assert front == pytest.approx(0.1 + HALF_RAD, abs=1e-9)
    assert math.isclose(under([9.0])[-1][0], 9.0 - HALF_RAD)
