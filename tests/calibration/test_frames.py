"""Clean frames out of every kind of dirt, and the counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import frames_of, steady_poses
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from agvbench.calibration import clean_frames, inspect_frames
from agvbench.types import Frames

T = np.arange(-0.25, 5, 1 / 120)


def drive(noise_m=5e-4, seed=0, speed=0.3, front=0.4):
    """Rest for a quarter of a second, then drive."""
    poses = steady_poses(front, 0.0, speed, np.maximum(T, 0))
    return frames_of(T, poses, np.random.default_rng(seed), noise_m, 4e-3)


def with_wrong(frames, where, dx=2.0, turn=0.0):
    x, heading = frames.x_m.copy(), frames.heading_rad.copy()
    x[where] += dx
    heading[where] += turn
    return replace(frames, x_m=x, heading_rad=heading)


def test_clean_frames_stay_as_they_are():
    frames = drive()
    kept, quality = inspect_frames(frames)
    assert np.array_equal(kept.t_s, frames.t_s)
    assert np.array_equal(kept.x_m, frames.x_m)
    assert (quality.kept, quality.jumps, quality.lost, quality.gaps, quality.late) == (len(frames), 0, 0, 0, 0)
    assert quality.tracked_share == 1.0


@pytest.mark.parametrize(
    "where",
    [[0], [1], [300], [len(T) - 1], range(40, 46), range(100, 300), [5, 80, 81, 200, 400, 401, 402], range(60)],
)
def test_wrong_frames_go_and_no_others(where):
    where = list(where)
    kept, quality = inspect_frames(with_wrong(drive(), where))
    assert quality.jumps == len(where)
    assert np.array_equal(kept.t_s, np.delete(T, where))


def test_a_jump_of_a_hand_s_breadth_and_a_body_the_wrong_way_round_are_seen():
    assert inspect_frames(with_wrong(drive(), [200], dx=0.06))[1].jumps == 1
    assert inspect_frames(with_wrong(drive(), range(200, 220), dx=0.0, turn=np.pi))[1].jumps == 20


@pytest.mark.parametrize("kick_rad", [0.02, 0.05, -0.1])
def test_a_seam_that_turns_the_vehicle_a_little_costs_none_of_the_run(kick_rad):
    kept, quality = inspect_frames(with_wrong(drive(), range(300, len(T)), dx=0.0, turn=kick_rad))
    assert (quality.jumps, len(kept)) == (0, len(T))


def test_a_body_that_was_seen_askew_for_a_moment_is_still_a_jump():
    assert inspect_frames(with_wrong(drive(), range(200, 220), dx=0.0, turn=0.1))[1].jumps == 20
    assert inspect_frames(with_wrong(drive(), range(300, len(T)), dx=0.0, turn=0.6))[1].jumps > 0


def test_one_frame_in_ten_wrong_at_random():
    rng = np.random.default_rng(3)
    where = np.flatnonzero(rng.random(len(T)) < 0.1)
    frames = drive()
    x, y = frames.x_m.copy(), frames.y_m.copy()
    x[where] += rng.uniform(0.5, 3, len(where))
    y[where] -= rng.uniform(0.5, 3, len(where))
    kept, quality = inspect_frames(replace(frames, x_m=x, y_m=y))
    assert quality.jumps == len(where)
    assert set(kept.t_s) == set(np.delete(T, where))


@pytest.mark.parametrize("speed", [0.0, 0.06, 0.32, 3.0])
@pytest.mark.parametrize("noise_m", [0.0, 5e-4, 2e-3])
def test_honest_motion_is_never_called_a_jump(speed, noise_m):
    assert inspect_frames(drive(noise_m=noise_m, speed=speed, seed=7))[1].jumps == 0


def test_a_short_dash_after_a_long_rest_is_no_jump():
    t = np.arange(0, 20, 1 / 100)
    poses = steady_poses(0.3, 0.0, 2.0, np.maximum(t - 18.5, 0))
    assert inspect_frames(frames_of(t, poses))[1].jumps == 0


def test_untracked_doubled_late_and_lost_are_counted():
    frames = drive()
    untracked = [50, 51, 52, 400]
    tracked, x = frames.tracked.copy(), frames.x_m.copy()
    tracked[untracked], x[untracked] = False, np.nan
    order = list(range(len(T)))
    order.insert(101, 100)  # a double
    order[200], order[203] = order[203], order[200]
    del order[300:310]  # ten are lost
    kept, quality = inspect_frames(replace(frames, tracked=tracked, x_m=x).select(np.array(order)))
    assert (quality.untracked, quality.doubled, quality.lost) == (4, 1, 10)
    assert quality.late >= 1
    assert quality.gaps == 3
    assert quality.longest_gap_s == pytest.approx(11 / 120)
    assert np.all(np.diff(kept.t_s) > 0)
    assert len(kept) == len(T) - 14
    assert quality.tracked_share == pytest.approx(1 - 14 / len(T))


def test_a_doubled_frame_number_with_another_time_stamp_is_a_double():
    frames = drive()
    number = frames.frame.copy()
    number[10] = number[9]
    assert inspect_frames(replace(frames, frame=number))[1].doubled == 1
    restarted = replace(frames, frame=np.concatenate([np.arange(300), np.arange(len(T) - 300)]))
    assert inspect_frames(restarted)[1].doubled == 0


def test_a_single_mad_time_stamp_does_not_cost_the_rest():
    frames = drive()
    for wrong in (1e6, -1e6, np.nan):
        times = frames.t_s.copy()
        times[150] = wrong
        kept, quality = inspect_frames(replace(frames, t_s=times))
        assert quality.bad_time == 1
        assert len(kept) == len(T) - 1


@given(st.lists(st.tuples(*[st.floats()] * 4, st.booleans(), st.integers(-1, 9)), max_size=40))
@settings(deadline=None, phases=[Phase.explicit, Phase.generate])
def test_whatever_comes_in_what_comes_out_is_in_order_tracked_and_was_in_it(rows):
    columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else [np.empty(0)] * 6
    t, x, y, heading, tracked, number = columns
    n = len(rows)
    frames = Frames(t, x, y, heading, tracked.astype(bool), number.astype(np.int64), np.empty(n), np.empty(n))
    kept, quality = inspect_frames(frames)
    assert np.all(np.diff(kept.t_s) > 0)
    assert kept.tracked.all()
    assert np.isfinite([kept.x_m, kept.y_m, kept.heading_rad]).all()
    assert set(kept.t_s) <= set(t)
    assert 0 <= quality.tracked_share <= 1
    found = quality.untracked + quality.doubled + quality.bad_time + quality.jumps
    assert quality.kept + found == quality.frames


def test_no_frames_and_one_frame():
    assert inspect_frames(Frames.empty())[1].tracked_share == 0.0
    assert len(clean_frames(drive().select(np.array([3])))) == 1


@given(st.lists(st.integers(0, 30), min_size=1, max_size=40))
@settings(deadline=None)
def test_as_few_frames_as_can_be_are_said_to_have_come_late(arrivals):
    """The longest sequence that does not fall, counted here by trying every frame as its last."""
    longest: list[int] = []
    for k, time in enumerate(arrivals):
        longest.append(1 + max((longest[i] for i in range(k) if arrivals[i] <= time), default=0))
    t = np.array(arrivals) / 100.0
    still = np.zeros(len(t))
    frames = Frames(t, still, still, still, still == 0.0, np.full(len(t), -1), still, still)
    assert inspect_frames(frames)[1].late == len(arrivals) - max(longest)
