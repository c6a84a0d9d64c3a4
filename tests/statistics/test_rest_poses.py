import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statistics_samples import make_run

from agvbench.errors import FitError
from agvbench.statistics.rest_poses import end_pose, start_pose
from agvbench.types import Frames, Pose, wrap_angle

START, END = (0.3, -0.2, 3.1), (2.3, -0.1, 3.3)


def spoil(run, **columns):
    return dataclasses.replace(run, frames=dataclasses.replace(run.frames, **columns))


def test_poses_at_rest_are_found_to_the_noise_of_their_means():
    run = make_run(START, END, noise_m=5e-4)
    for rest, truth in ((start_pose(run), START), (end_pose(run), END)):
        assert math.dist(rest.pose[:2], truth[:2]) < 4 * rest.stderr_x_m
        assert abs(wrap_angle(rest.pose.heading_rad - truth[2])) < 4 * rest.stderr_heading_rad
        assert 3e-5 < rest.stderr_x_m < 1.2e-4


def test_standard_errors_are_those_of_many_repetitions():
    rests = [end_pose(make_run(START, END, noise_m=5e-4, seed=seed)) for seed in range(200)]
    scatter = np.std([rest.pose.x_m for rest in rests])
    assert scatter == pytest.approx(np.mean([rest.stderr_x_m for rest in rests]), rel=0.2)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 0.3),
    st.floats(0.0, 0.3),
    st.sampled_from([0.05, 1.0, 1e3]),
)
def test_untracked_doubled_late_and_wild_frames_move_nothing(seed, untracked, wild, jump_m):
    run = make_run(START, END, noise_m=2e-4, seed=1)
    rng = np.random.default_rng(seed)
    n = len(run.frames)
    lost, jumps = rng.random(n) < untracked, rng.random(n) < wild / 2
    x = np.where(lost, np.nan, run.frames.x_m + jumps * jump_m)
    heading = run.frames.heading_rad + jumps * 2.0 + 2 * math.pi * rng.integers(-1, 2, n)
    spoiled = spoil(run, x_m=x, heading_rad=heading, tracked=~lost)
    order = rng.permutation(np.concatenate([np.arange(n), rng.integers(0, n, n // 3)]))
    spoiled = dataclasses.replace(spoiled, frames=spoiled.frames.select(order))
    for rest, truth in ((start_pose(spoiled), START), (end_pose(spoiled), END)):
        assert math.dist(rest.pose[:2], truth[:2]) < 3e-4
        assert abs(wrap_angle(rest.pose.heading_rad - truth[2])) < 2e-3


def test_a_vehicle_that_still_settles_is_read_where_it_comes_to_rest():
    slow = make_run(START, END, settle_s=0.12)
    assert math.dist(end_pose(slow).pose[:2], END[:2]) < 2e-4


def test_a_vehicle_that_still_moves_at_the_end_has_no_end_pose():
    run = make_run(START, END)
    cut = dataclasses.replace(
        run,
        commands=dataclasses.replace(run.commands, t_s=np.array([0.0, 0.2])),
        frames=run.frames.select(run.frames.t_s < 0.9),
    )
    with pytest.raises(FitError, match=r"r1: still moving when the frames end: 2.*m/s"):
        end_pose(cut)


def test_no_frames_at_rest_are_said_and_not_guessed():
    run = make_run(START, END)
    with pytest.raises(FitError, match="no tracked frame at rest before the first command"):
        start_pose(dataclasses.replace(run, frames=run.frames.select(run.frames.t_s > 0)))
    with pytest.raises(FitError, match="no tracked frame after the stop"):
        end_pose(dataclasses.replace(run, frames=run.frames.select(run.frames.t_s < 0.5)))
    with pytest.raises(FitError, match="no tracked frame"):
        start_pose(dataclasses.replace(run, frames=Frames.empty()))


def test_a_single_frame_gives_a_pose_of_unknown_error():
    run = make_run(START, END)
    rest = start_pose(dataclasses.replace(run, frames=run.frames.select(np.array([5]))))
    assert rest.pose[:2] == pytest.approx(START[:2])
    assert math.isnan(rest.stderr_x_m)


def test_headings_across_the_jump_of_two_pi_are_averaged_on_the_circle():
    run = make_run((0, 0, math.pi), (1, 0, math.pi), target=Pose(1, 0, 0), noise_m=1e-3)
    wrapped = spoil(run, heading_rad=np.angle(np.exp(1j * run.frames.heading_rad)))
    assert abs(wrap_angle(start_pose(wrapped).pose.heading_rad - math.pi)) < 4e-3
