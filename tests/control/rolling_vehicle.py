"""A vehicle that does at once what it is asked, integrated in small steps: a truth of its own for controllers."""

from __future__ import annotations

import math

from agvbench.control import ControlInput, Motion
from agvbench.types import Pose

CYCLE_S, STEPS = 0.1, 20


def driven(controller, reference, offset=(0.0, 0.0, 0.0), limit_s=120.0):
    """Drive from `offset` (m, m, rad) in the start frame; return the marker centroid's poses and the motions."""
    centroid, t_s = Pose(*offset), 0.0
    poses, motions = [centroid], []
    while t_s < limit_s:
        given = ControlInput(t_s, centroid, t_s, reference.feed_forward(t_s), reference.planned(t_s))
        motion = controller(given)
        if motion is None:
            return poses, motions
        centroid = rolled(centroid, motion, reference.ahead_m)
        t_s += CYCLE_S
        poses.append(centroid)
        motions.append(motion)
    raise AssertionError(f"not at the end after {limit_s} s")


def rolled(pose: Pose, motion: Motion, ahead_m: float) -> Pose:
    """Return where the centroid is after a cycle in which its reference point, `ahead_m` before it, rolls."""
    heading = pose.heading_rad
    x_m, y_m = pose.x_m + ahead_m * math.cos(heading), pose.y_m + ahead_m * math.sin(heading)
    for _ in range(STEPS):
        step_m = motion.speed_mps * CYCLE_S / STEPS
        middle = heading + 0.5 * step_m * motion.curvature_per_m
        x_m, y_m = x_m + step_m * math.cos(middle), y_m + step_m * math.sin(middle)
        heading += step_m * motion.curvature_per_m
    return Pose(x_m - ahead_m * math.cos(heading), y_m - ahead_m * math.sin(heading), heading)
