"""A leg: a stretch of time in which nothing about the vehicle's motion changes; and the path that legs follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import PlanError
from agvbench.model import VehicleModel
from agvbench.planning.trajectories.segments import Arc, Straight, axle_speed
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.planning.workspace import DEFAULT_MARGIN_M, STOPPING_S
from agvbench.types import Floats, Pose, wrap_angle
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import body_motion

_ROUNDING_RAD = 1e-9


@dataclass(frozen=True)
class Leg:
    """A stretch of time in which nothing about the vehicle's motion changes.

    Parameters
    ----------
    where
        How messages call it.
    front, rear
        Axle angles [rad]. The front value of a differential vehicle is its yaw rate [rad/s], and the rear one is 0.
    speed_mps
        Speed of both axles [m/s], signed; 0 at rest and while a differential vehicle turns on the spot.
    duration_s
        Duration [s].
    is_rest
        Whether the vehicle stands still; the angles are then those to which the steering is set.
    """

    where: str
    front: float
    rear: float
    speed_mps: float
    duration_s: float
    is_rest: bool = False

    def motion(self, geometry: Geometry) -> tuple[float, float, float]:
        """Return speed [m/s], sideslip [rad] and yaw rate [rad/s] of the centroid; all zero at rest."""
        if self.is_rest:
            return 0.0, 0.0, 0.0
        speed, sideslip, yaw_rate = body_motion(self.front, self.rear, self.speed_mps, self.speed_mps, geometry)
        return float(speed), float(sideslip), float(yaw_rate)


def signed_speed(segment: Straight | Arc, trajectory: Trajectory, model: VehicleModel, *, where: str) -> float:
    """Return the speed of the drive on a segment [m/s], negative backward; raise `PlanError` if it is out of reach."""
    backward = segment.direction == "backward"
    low, high = model.drive.output_range
    full = -low if backward else high
    if not full > 0.0:
        raise PlanError(f"this vehicle does not drive {segment.direction}", where=where)
    speed = axle_speed(trajectory.speed if segment.speed is None else segment.speed, full, where=where)
    return -speed if backward else speed


def leg_along(
    segment: Straight | Arc, front: float, rear: float, speed_mps: float, geometry: Geometry, *, where: str
) -> Leg:
    """Return the leg that drives a segment with these values, for as long as its length or angle takes."""
    centroid, _, yaw_rate = (abs(float(x)) for x in body_motion(front, rear, speed_mps, speed_mps, geometry))
    if segment.duration_s is not None:
        duration = segment.duration_s
    elif segment.length_m is not None:
        duration = segment.length_m / centroid
    else:
        assert isinstance(segment, Arc)  # noqa: S101 - a straight has a length or a duration
        assert segment.angle_deg is not None  # noqa: S101 - an arc has one of the three
        duration = math.radians(segment.angle_deg) / yaw_rate
    return Leg(where, front, rear, speed_mps, duration)


_SWEPT_STEP_M = 0.005


def advance(leg: Leg, pose: tuple[float, float, float], after_s: Floats, geometry: Geometry) -> Floats:
    """Return the poses `after_s` seconds (n,) into a leg that begins at `pose`, shape (n, 3); heading unwrapped."""
    speed, sideslip, yaw_rate = leg.motion(geometry)
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
    """Return the last pose of a path (n, 4) as `sample` returns it; half a turn is +π, whatever its rounding."""
    x, y, heading = path[-1, 1:].tolist()
    wrapped = wrap_angle(heading)
    return Pose(x, y, math.pi if wrapped < _ROUNDING_RAD - math.pi else wrapped)


def swept(legs: Sequence[Leg], geometry: Geometry) -> Floats:
    """Return when and where the centres of both axles pass: the floor that the vehicle's length needs.

    Returns
    -------
    t [s], x [m], y [m] in the start frame, shape (n, 3), a row of each axle every 5 mm of the centroid's path or
    less. Of circles driven over and over only the first is there, so that hours need no more rows than minutes.
    """
    t, pose = 0.0, (0.0, 0.0, 0.0)
    rows = [_axles(np.zeros(1), np.zeros((1, 3)), geometry)]
    for leg in legs:
        speed, _, yaw_rate = leg.motion(geometry)
        once_s = min(leg.duration_s, 2.0 * np.pi / abs(yaw_rate)) if yaw_rate else leg.duration_s
        after = np.linspace(0.0, once_s, 2 + int(abs(speed) * once_s / _SWEPT_STEP_M))[1:]
        rows.append(_axles(t + after, advance(leg, pose, after, geometry), geometry))
        x, y, heading = advance(leg, pose, np.array([leg.duration_s]), geometry)[0].tolist()
        t, pose = t + leg.duration_s, (x, y, heading)
    return np.concatenate(rows)


def stops(path: Floats) -> Floats:
    """Return when and where a vehicle on a `path` (n, 4) of t, x, y, heading would come to rest if it were stopped.

    A supervisor stops a vehicle that could not come to rest inside the workspace. Where that takes more than the
    workspace's margin, the point lies so far ahead of the path; slower motion has no point. Shape (m, 3): t [s], x [m],
    y [m].
    """
    step = np.diff(path[:, 1:3], axis=0)
    velocity = step / np.maximum(np.diff(path[:, 0]), 1e-9)[:, None]
    speed = np.hypot(*velocity.T)
    ahead_m = STOPPING_S * speed - DEFAULT_MARGIN_M
    at = np.flatnonzero(ahead_m > 0.0)
    rest = path[1:, 1:3][at] + velocity[at] * (ahead_m[at] / speed[at])[:, None]
    return np.column_stack([path[1:, 0][at], rest])


def _axles(t_s: Floats, poses: Floats, geometry: Geometry) -> Floats:
    along = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    front, rear = poses[:, :2] + geometry.front_axle_m * along, poses[:, :2] - geometry.rear_axle_m * along
    return np.column_stack([np.repeat(t_s, 2), np.stack([front, rear], axis=1).reshape(-1, 2)])


def axles_swept(path: Floats, geometry: Geometry) -> Floats:
    """Return when and where the axles' centres pass on a `path` (n, 4) of t, x, y, heading; shape (2n, 3)."""
    return _axles(path[:, 0], path[:, 1:], geometry)
