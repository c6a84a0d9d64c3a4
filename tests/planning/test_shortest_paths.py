"""Dubins and Reeds-Shepp paths against OMPL, and what must hold of any shortest path."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from planning_truth import end_of

from agvbench.errors import PlanError
from agvbench.planning.shortest_paths import dubins, reeds_shepp
from agvbench.planning.shortest_paths.pieces import length_of
from agvbench.types import Pose

PLANNERS = {
    "dubins": (dubins, "DubinsStateSpace"),
    "reeds_shepp": (reeds_shepp, "ReedsSheppStateSpace"),
}
ORIGIN = Pose(0.0, 0.0, 0.0)
coordinates = st.floats(-5.0, 5.0)
headings = st.floats(-math.pi, math.pi)
poses = st.builds(Pose, coordinates, coordinates, headings)
radii = st.floats(0.05, 5.0)
paths = pytest.mark.parametrize(
    "shortest",
    [dubins.shortest_path, dubins.shortest_path_backward, reeds_shepp.shortest_path],
    ids=["forward", "backward", "either"],
)
quick = settings(deadline=None, max_examples=40)


def random_pairs(count, seed):
    """Half of the pairs far apart, half within a few radii of each other, where the curly words live."""
    rng = np.random.default_rng(seed)
    starts, far = (
        np.column_stack([rng.uniform(-5.0, 5.0, (count, 2)), rng.uniform(-math.pi, math.pi, count)]) for _ in range(2)
    )
    near = starts + rng.normal(0.0, 0.7, (count, 3))
    return starts, np.where((np.arange(count) % 2 == 0)[:, None], far, near)


def ompl_lengths(space, starts, goals):
    start, goal = space.allocState(), space.allocState()
    lengths = np.empty(len(starts))
    for i, (from_pose, to_pose) in enumerate(zip(starts.tolist(), goals.tolist(), strict=True)):
        start.setXY(*from_pose[:2])
        start.setYaw(from_pose[2])
        goal.setXY(*to_pose[:2])
        goal.setYaw(to_pose[2])
        lengths[i] = space.distance(start, goal)
    return lengths


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("radius_m", [0.22, 0.7, 3.0])
def test_a_hundred_thousand_lengths_agree_with_ompl(name, radius_m):
    base = pytest.importorskip("ompl.base", reason="ompl has no wheel for this Python")
    module, space = PLANNERS[name][0], getattr(base, PLANNERS[name][1])
    starts, goals = random_pairs(100_000 // 3 + 1, seed=int(100 * radius_m))
    ours = module.shortest_lengths(starts, goals, radius_m)
    np.testing.assert_allclose(ours, ompl_lengths(space(radius_m), starts, goals), rtol=0.0, atol=1e-9)


def test_the_random_pairs_need_every_word():
    best = np.nanargmin(dubins.word_lengths(*random_pairs(33_334, seed=70), 0.7).sum(axis=1), axis=0)
    assert np.bincount(best, minlength=6).min() > 100


@paths
@quick
@given(start=poses, goal=poses, radius_m=radii)
@example(start=ORIGIN, goal=ORIGIN, radius_m=1.0)
@example(start=ORIGIN, goal=Pose(0.0, 2.0, math.pi), radius_m=1.0)
@example(start=ORIGIN, goal=Pose(4.0, 0.0, 0.0), radius_m=1.0)
@example(start=ORIGIN, goal=Pose(0.0, 0.0, math.pi), radius_m=1.0)
@example(start=ORIGIN, goal=Pose(0.1, 0.1, 0.0), radius_m=1.0)
def test_a_path_reaches_its_goal_and_is_no_shorter_than_the_straight_line(shortest, start, goal, radius_m):
    path = shortest(start, goal, radius_m)
    missed = end_of(path, start).relative_to(goal)
    assert np.allclose(missed, 0.0, atol=1e-7)
    assert length_of(path) >= math.dist(start[:2], goal[:2]) - 1e-7
    assert all(piece.length_m > 0.0 for piece in path)


@paths
@quick
@given(goal=poses, radius_m=radii)
def test_the_mirrored_goal_has_a_mirrored_path(shortest, goal, radius_m):
    assume(abs(goal.y_m) > 1e-3)
    mirrored = Pose(goal.x_m, -goal.y_m, -goal.heading_rad)
    path, other = shortest(ORIGIN, goal, radius_m), shortest(ORIGIN, mirrored, radius_m)
    assert length_of(other) == pytest.approx(length_of(path), abs=1e-7)
    end = end_of([piece.mirrored() for piece in path], ORIGIN)
    assert np.allclose(end.relative_to(mirrored), 0.0, atol=1e-7)


@quick
@given(start=poses, goal=poses, radius_m=radii)
def test_two_gears_are_never_longer_than_one(start, goal, radius_m):
    both = length_of(reeds_shepp.shortest_path(start, goal, radius_m))
    for one in (dubins.shortest_path, dubins.shortest_path_backward):
        assert both <= length_of(one(start, goal, radius_m)) + 1e-7


@quick
@given(start=poses, goal=poses, radius_m=radii)
def test_backward_path_is_driven_backward_and_as_long_as_the_way_back_forward(start, goal, radius_m):
    path = dubins.shortest_path_backward(start, goal, radius_m)
    assert all(piece.backward for piece in path)
    assert length_of(path) == pytest.approx(length_of(dubins.shortest_path(goal, start, radius_m)), abs=1e-7)


@paths
@quick
@given(shift=poses, start=poses, goal=poses)
def test_a_path_does_not_depend_on_the_frame(shortest, shift, start, goal):
    moved = shortest(shift.compose(start), shift.compose(goal), 0.8)
    assert length_of(moved) == pytest.approx(length_of(shortest(start, goal, 0.8)), abs=1e-6)


@paths
@pytest.mark.parametrize("forward_m", [1e-8, 3e-6, 2e-4, 0.01, 1.0])
def test_the_way_straight_ahead_is_one_straight(shortest, forward_m):
    backward = shortest is dubins.shortest_path_backward
    (piece,) = shortest(ORIGIN, Pose(-forward_m if backward else forward_m, 0.0, 0.0), 0.5)
    assert (piece.side, piece.backward) == ("straight", backward)
    assert piece.length_m == pytest.approx(forward_m, abs=1e-9)


@paths
def test_no_way_between_equal_poses(shortest):
    assert shortest(Pose(1.0, 2.0, 3.0), Pose(1.0, 2.0, 3.0), 0.5) == ()


@paths
@pytest.mark.parametrize("radius_m", [0.0, -1.0, math.nan, math.inf])
def test_a_radius_that_is_none_is_refused(shortest, radius_m):
    with pytest.raises(PlanError, match="turning radius is not a positive number"):
        shortest(ORIGIN, Pose(1.0, 1.0, 0.0), radius_m)


@paths
def test_a_pose_that_is_not_finite_is_refused(shortest):
    with pytest.raises(PlanError, match="not finite"):
        shortest(ORIGIN, Pose(1.0, math.nan, 0.0), 1.0)
