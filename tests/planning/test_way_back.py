"""A way back ends at the start, on a straight, and stays inside: judged by integrating it, not by its own formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from planning_truth import end_of

from agvbench.errors import PlanError
from agvbench.planning import Workspace
from agvbench.planning.shortest_paths.pieces import length_of
from agvbench.planning.shortest_paths.reeds_shepp import paths_by_length, shortest_path
from agvbench.planning.shortest_paths.return_path import GearLeg, Guided, plan_return_path
from agvbench.types import Pose, wrap_angle
from agvbench.vehicle.geometry import Geometry

GEOMETRY = Geometry(0.181, 0.121)
ROOM = Workspace.rectangle(5.0, 4.0)
RADII, LEADS = (0.9, 0.6, 0.45), (0.8, 0.6, 0.4)
POSES = st.builds(Pose, st.floats(-1.9, 1.9), st.floats(-1.4, 1.4), st.floats(-math.pi, math.pi))


def driven(leg: GearLeg, start: np.ndarray) -> np.ndarray:
    """Integrate curvature over distance from `start`; return where it leads."""
    x, y, course = start
    sign = -1.0 if leg.backward else 1.0
    for step, curvature in zip(sign * np.diff(leg.along_m), leg.curvature_per_m[:-1], strict=True):
        for _ in range(4):
            middle = course + 0.125 * curvature * step
            x, y = x + 0.25 * step * math.cos(middle), y + 0.25 * step * math.sin(middle)
            course += 0.25 * curvature * step
    return np.array([x, y, course])


@settings(max_examples=30)
@given(POSES, POSES, st.sampled_from([0.0, -0.121]), st.floats(-0.1, 0.1))
def test_a_way_leads_to_the_start_along_a_straight_and_inside(
    seen: Pose, start: Pose, forward_m: float, crab_rad: float
) -> None:
    guided = Guided(GEOMETRY, forward_m, crab_rad)
    legs = plan_return_path(seen, start, guided, ROOM, radii_m=RADII, leads_m=LEADS)
    at = np.array(guided.pose(seen))
    for leg in legs:
        np.testing.assert_allclose(leg.points[0][:2], at[:2], atol=1e-4)
        at = driven(leg, at)
        np.testing.assert_allclose(at[:2], leg.points[-1][:2], atol=1e-4)
        heading = leg.points[:, 2] - crab_rad
        for axle_m in (0.181 - forward_m, -0.121 - forward_m):
            x, y = leg.points[:, 0] + axle_m * np.cos(heading), leg.points[:, 1] + axle_m * np.sin(heading)
            inside_m = np.minimum(2.5 - abs(x), 2.0 - abs(y)).min()
            assert inside_m > 0.25 - 0.01 or inside_m > min(_inside(seen), _inside(start)) - 0.01
    goal = guided.pose(start)
    np.testing.assert_allclose(at[:2], goal[:2], atol=1e-3)
    assert abs(wrap_angle(at[2] - goal.heading_rad)) < 1e-6
    straight = legs[-1].along_m >= legs[-1].length_m - min(LEADS) + 0.01
    assert not legs[-1].curvature_per_m[straight].any()


def _inside(pose: Pose) -> float:
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return min(min(2.5 - abs(pose.x_m + axle_m * c), 2.0 - abs(pose.y_m + axle_m * s)) for axle_m in (0.181, -0.121))


@settings(max_examples=30)
@given(POSES, POSES)
@example(Pose(0.0, 0.0, 0.0), Pose(3e-06, 0.0, 0.0))
def test_every_word_reaches_the_goal_and_the_first_is_the_shortest(start: Pose, goal: Pose) -> None:
    paths = paths_by_length(start, goal, 0.5)
    for path in paths:
        end = end_of(path, start)
        assert math.dist(end[:2], goal[:2]) < 1e-6
        assert abs(wrap_angle(end.heading_rad - goal.heading_rad)) < 1e-6
    lengths = [length_of(path) for path in paths]
    assert lengths == pytest.approx(sorted(lengths), abs=1e-9)
    assert lengths[0] == pytest.approx(length_of(shortest_path(start, goal, 0.5)))


def test_the_gear_can_be_asked_for() -> None:
    for backward in (False, True):
        legs = plan_return_path(
            Pose(0.01, 0.0, 0.0), Pose(0.0, 0.0, 0.0), Guided(GEOMETRY), ROOM, radii_m=RADII, leads_m=LEADS,
            gears=(backward,),
        )  # fmt: skip
        assert legs[-1].backward is backward


def test_where_there_is_no_way_that_is_said() -> None:
    narrow = Workspace.rectangle(1.0, 0.55, margin_m=0.25)
    with pytest.raises(PlanError, match=r"cannot drive back to its start: every way comes too close to the edge"):
        plan_return_path(
            Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 3.0), Guided(GEOMETRY), narrow, radii_m=RADII, leads_m=LEADS
        )
    with pytest.raises(PlanError, match=r"the vehicle stands 0.\d\d m outside"):
        plan_return_path(Pose(2.6, 0.0, 0.0), Pose(0.0, 0.0, 0.0), Guided(GEOMETRY), ROOM, radii_m=RADII, leads_m=LEADS)
