"""The gate against tracks whose wild frames the test put in itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agvbench.campaign.recordings.jump_detection import jumped
from agvbench.campaign.recordings.mapping import Gate
from agvbench.errors import InputError

GATE = Gate(max_speed_m_per_s=2.0, max_yaw_rate_rad_per_s=6.0)


def _track(frames: int = 1000) -> tuple[np.ndarray, ...]:
    """Return a circle of 1 m at 1 m/s and 100 Hz; its heading is wrapped."""
    t_s = np.arange(frames) / 100.0
    return t_s, np.cos(t_s), np.sin(t_s), (t_s + np.pi / 2.0 + np.pi) % (2.0 * np.pi) - np.pi


def test_a_clean_track_passes() -> None:
    assert not jumped(*_track(), GATE).any()
    assert jumped(*(np.empty(0),) * 4, GATE).shape == (0,)


def test_a_vehicle_that_stands_passes() -> None:
    t_s = np.arange(500) / 100.0
    assert not jumped(t_s, t_s * 0.0, t_s * 0.0, t_s * 0.0, GATE).any()


def test_a_gate_in_another_unit_is_told_and_not_waited_for() -> None:
    t_s = np.arange(100_000) / 100.0
    with pytest.raises(InputError, match=r"\[gate\]: the gate finds a jump nearly everywhere: 99999 in 100000 frames"):
        jumped(t_s, 1000.0 * t_s, t_s * 0.0, t_s * 0.0, GATE)


@settings(max_examples=50, deadline=None)
@given(rows=st.sets(st.integers(0, 999), min_size=1, max_size=60), far=st.floats(0.3, 50.0), seed=st.integers(0, 99))
def test_single_wild_frames_are_found_wherever_they_are(rows: set[int], far: float, seed: int) -> None:
    t_s, x_m, y_m, heading_rad = _track()
    wild = np.zeros(len(t_s), np.bool_)
    wild[list(rows)] = True
    toward = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(t_s))
    x_m, y_m = x_m + wild * far * np.cos(toward), y_m + wild * far * np.sin(toward)
    found = jumped(t_s, x_m, y_m, heading_rad, GATE)
    assert not found[~wild].any()
    # Neighbouring wild frames may by chance be reachable from each other, but not from the vehicle's frames.
    assert found[wild].all()


@pytest.mark.parametrize("start", [0, 30, 400])
def test_another_object_that_is_held_for_seconds_is_not_followed(start: int) -> None:
    t_s, x_m, y_m, heading_rad = _track()
    other = slice(start, start + 500)  # half of all frames: a gate that counts or that reaches farther follows it
    x_m[other], y_m[other], heading_rad[other] = 4.0, -1.0, 0.3
    found = jumped(t_s, x_m, y_m, heading_rad, GATE)
    assert found[other].all()
    assert found.sum() == 500


def test_a_flipped_heading_is_a_jump_and_a_wrap_is_not() -> None:
    t_s, x_m, y_m, heading_rad = _track()
    heading_rad[200:210] += np.pi
    heading_rad[500:] += 4.0 * np.pi
    np.testing.assert_array_equal(np.flatnonzero(jumped(t_s, x_m, y_m, heading_rad, GATE)), np.arange(200, 210))


def test_a_lost_stretch_is_bridged() -> None:
    t_s, x_m, y_m, heading_rad = (np.delete(column, slice(100, 400)) for column in _track())
    assert not jumped(t_s, x_m, y_m, heading_rad, GATE).any()
