"""Where legs lead: the expected path, in closed form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.planning.legs import Leg
from agvbench.types import Floats, Pose, wrap_angle
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import body_motion


def advance(leg: Leg, pose: tuple[float, float, float], after_s: Floats, geometry: Geometry) -> Floats:
    """Return the poses `after_s` seconds (n,) into a leg that begins at `pose`, shape (n, 3); heading unwrapped."""
    speed, sideslip, yaw_rate = (
        float(x) for x in body_motion(leg.front_rad, leg.rear_rad, leg.speed_mps, leg.speed_mps, geometry)
    )
    x, y, heading = pose
    turn = yaw_rate * after_s
    # The chord of an arc of angle 2a is its length times sin(a)/a, which is 1 on a straight.
    chord = speed * after_s * np.sinc(turn / (2.0 * np.pi))
    direction = heading + sideslip + 0.5 * turn
    return np.column_stack([x + chord * np.cos(direction), y + chord * np.sin(direction), heading + turn])


def sample(legs: Sequence[Leg], geometry: Geometry, step_s: float) -> Floats:
    """Return t [s], x [m], y [m], heading [rad, unwrapped] in the start frame, shape (n, 4).

    There is a row every `step_s` of each leg and at both of its ends.
    """
    rows = [np.zeros((1, 4))]
    for leg in legs:
        t, *pose = rows[-1][-1]
        steps = np.arange(step_s, leg.duration_s - 1e-9, step_s)
        after = np.append(steps, leg.duration_s)
        rows.append(np.column_stack([t + after, advance(leg, (pose[0], pose[1], pose[2]), after, geometry)]))
    return np.concatenate(rows)


def end_pose(path: Floats) -> Pose:
    """Return the last pose of a path (n, 4) as `sample` returns it."""
    x, y, heading = path[-1, 1:].tolist()
    return Pose(x, y, wrap_angle(heading))


def swept_points(path: Floats, geometry: Geometry) -> Floats:
    """Return where the centres of both axles pass, shape (2n, 2): the floor that the vehicle's length needs."""
    along = np.column_stack([np.cos(path[:, 3]), np.sin(path[:, 3])])
    return np.concatenate([path[:, 1:3] + geometry.front_axle_m * along, path[:, 1:3] - geometry.rear_axle_m * along])
